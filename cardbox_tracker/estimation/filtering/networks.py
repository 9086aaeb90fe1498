"""Small trained neural networks and their data files."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO, NamedTuple, TypeVar

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import kernel
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import UnreadableFileError, regular_file

Layer = tuple[FloatArray, FloatArray]
"""Weights (networks, inputs, outputs) and biases (networks, 1, outputs)."""

Read = TypeVar("Read")

# Limit of a file's size; the package's networks have 1 MB.
_MOST_BYTES = 64 * 2**20
# Errors of numpy about headers that were made up.
_DAMAGED = ValueError, TypeError, MemoryError, EOFError, SyntaxError, TokenError
_MADE_BY = "as learning/correction.py writes them"


class Network(NamedTuple):
    """An ensemble of feed-forward networks of the same shape, whose answers are averaged.

    Attributes:
        mean: means of the features, (F,).
        scale: standard deviations of the features, (F,).
        most: limit of the absolute scaled features.
        weights: weights of each layer, (networks, inputs, outputs).
        biases: biases of each layer, (networks, 1, outputs).
        unit: factors of the answers, (A,).
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    unit: FloatArray

    def __call__(self, features: FloatArray) -> FloatArray:
        """Return the answers, (n, A), to features (n, F)."""
        answers = np.zeros((len(features), len(self.unit)))
        scaling = self.mean, self.scale, self.most
        # For two rows, compiled code is faster than calls of numpy.
        _add_answers(features, scaling, self.weights, self.biases, self.unit, answers)
        return answers


class RecurrentNetwork(NamedTuple):
    """An ensemble of recurrent networks of the same shape, whose answers are averaged.

    The layers are a linear layer, a gated recurrent unit with ``nodes`` hidden values (Cho et al.
    2014; as in cuDNN, the reset gate acts after the product), and two linear layers:

        v = relu(input_layer(scaled features))
        r, u = sigmoid of the first two parts of gru_input(v) + gru_hidden(hidden)
        candidate = tanh(third part of gru_input(v) + r * third part of gru_hidden(hidden))
        hidden = (1 - u) candidate + u hidden
        answers = output_layers[1](relu(output_layers[0]([hidden, v])))

    Attributes:
        mean: means of the features, (F,).
        scale: standard deviations of the features, (F,).
        most: limit of the absolute scaled features.
        input_layer: weights (networks, F, inputs) and biases (networks, 1, inputs).
        gru_input: weights (networks, inputs, 3 nodes) and biases.
        gru_hidden: weights (networks, nodes, 3 nodes) and biases.
        output_layers: weights and biases of the last two layers.
        unit: factors of the answers, (A,).
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    input_layer: Layer
    gru_input: Layer
    gru_hidden: Layer
    output_layers: tuple[Layer, Layer]
    unit: FloatArray

    def initial_hidden(self, rows: int) -> FloatArray:
        """Return the hidden state, (networks, rows, nodes), before the first frame."""
        weights = self.gru_hidden[0]
        return np.zeros((len(weights), rows, weights.shape[1]), weights.dtype)

    def __call__(
        self, features: FloatArray, hidden: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the answers to features (rows, F), and the next hidden state.

        Returns:
            Mean of the networks' answers, (rows, A); their standard deviation, (rows, A), which is
            large for features unlike those of the training; the hidden state.
        """
        nodes = hidden.shape[2]
        scaled = scaled_features(features, self.mean, self.scale, self.most)
        inputs = np.maximum(_linear(scaled.astype(hidden.dtype), self.input_layer), 0.0)
        of_input, of_hidden = _linear(inputs, self.gru_input), _linear(hidden, self.gru_hidden)
        gates = _sigmoid(of_input[..., : 2 * nodes] + of_hidden[..., : 2 * nodes])
        reset, update = gates[..., :nodes], gates[..., nodes:]
        candidate = np.tanh(of_input[..., 2 * nodes :] + reset * of_hidden[..., 2 * nodes :])
        hidden = candidate + update * (hidden - candidate)
        first, last = self.output_layers
        both = np.concatenate([hidden, inputs], axis=2)
        answers = np.asarray(_linear(np.maximum(_linear(both, first), 0.0), last), np.float64)
        return answers.mean(axis=0) * self.unit, answers.std(axis=0) * self.unit, hidden


@kernel
def _add_answers(
    features: FloatArray,
    scaling: tuple[FloatArray, FloatArray, float],
    weights: tuple[FloatArray, ...],
    biases: tuple[FloatArray, ...],
    unit: FloatArray,
    answers: FloatArray,
) -> None:
    """Add the mean answers (n, A) of all networks of a :class:`Network`."""
    mean, scale, most = scaling
    scaled, networks = np.empty(features.shape[1]), weights[0].shape[0]
    for row in range(features.shape[0]):
        for i in range(features.shape[1]):
            scaled[i] = min(max((features[row, i] - mean[i]) / scale[i], -most), most)
        for network in range(networks):
            values = scaled
            for number in range(len(weights)):
                inputs, outputs = weights[number].shape[1:]
                sums = biases[number][network, 0].copy()
                for i in range(inputs):
                    value = values[i]
                    if number > 0 and value < 0.0:
                        continue
                    for o in range(outputs):
                        sums[o] += value * weights[number][network, i, o]
                values = sums
            for o in range(answers.shape[1]):
                answers[row, o] += values[o] * (unit[o] / networks)


def scaled_features(
    features: FloatArray, mean: FloatArray, scale: FloatArray, most: float
) -> FloatArray:
    """Return (features - ``mean``) / ``scale``, (..., F), limited to -``most``..``most``."""
    scaled: FloatArray = np.clip((features - mean) / scale, -most, most)
    return scaled


def _linear(inputs: FloatArray, layer: Layer) -> FloatArray:
    """Return the outputs (networks, rows, outputs) of a layer to inputs (..., rows, inputs)."""
    outputs: FloatArray = inputs @ layer[0] + layer[1]
    return outputs


def _sigmoid(values: FloatArray) -> FloatArray:
    # This form has no overflow for any value.
    result: FloatArray = 0.5 * (1.0 + np.tanh(0.5 * values))
    return result


@cache
def load_network(name: str) -> Network:
    """Return the network of the package in the data file ``name``."""
    return _packaged(name, read_network)


@cache
def load_recurrent_network(name: str) -> RecurrentNetwork:
    """Return the recurrent network of the package in the data file ``name``."""
    return _packaged(name, read_recurrent_network)


def _packaged(name: str, read: Callable[[Path], Read]) -> Read:
    with resources.as_file(resources.files(__package__).joinpath(name)) as path:
        return read(path)


def read_network(path: Path) -> Network:
    """Return the network in a file written by ``learning/networks.py``."""
    data = _arrays(path, np.float64)
    layers = sum(name.startswith("weights") for name in data)
    return Network(
        data["mean"],
        data["scale"],
        float(data["most"]),
        tuple(data[f"weights{i}"] for i in range(layers)),
        tuple(data[f"biases{i}"] for i in range(layers)),
        data["unit"],
    )


def read_recurrent_network(path: Path) -> RecurrentNetwork:
    """Return the recurrent network in a file written by ``learning/networks.py``.

    Raises:
        CardboxError: the file cannot be read or is no such network; the text names the wrong array.
    """
    try:
        with regular_file(path, _MOST_BYTES) as file:
            with zipfile.ZipFile(file) as archive:
                if sum(member.file_size for member in archive.infolist()) > _MOST_BYTES:
                    raise CardboxError(f"{path} has over {_MOST_BYTES // 2**20} MB; expected a few")
            file.seek(0)
            data = _arrays(file, np.float32)
    except UnreadableFileError as error:
        raise CardboxError(f"{path}: {error}; give a network's file") from None
    except (*_DAMAGED, zipfile.BadZipFile) as error:
        raise CardboxError(f"{path} is no network: {error}; {_MADE_BY}") from None
    try:
        input_layer, gru_input, gru_hidden, first, last = (
            (data[f"weights{i}"], data[f"biases{i}"]) for i in range(5)
        )
        mean, scale, most, unit = data["mean"], data["scale"], float(data["most"]), data["unit"]
    except (KeyError, TypeError) as error:
        raise CardboxError(f"{path} is no recurrent network: {error}; {_MADE_BY}") from None
    network = RecurrentNetwork(
        mean, scale, most, input_layer, gru_input, gru_hidden, (first, last), unit
    )
    _check_shapes(path, network, data)
    return network


def _check_shapes(path: Path, network: RecurrentNetwork, data: dict[str, FloatArray]) -> None:
    """Raise CardboxError unless all numbers are finite and the shapes of the layers agree."""
    answers = network.unit.size
    try:
        networks, features, inputs = network.input_layer[0].shape
        nodes = network.gru_hidden[0].shape[1]
        left = network.output_layers[0][0].shape[2]
    except (ValueError, IndexError):
        raise CardboxError(f"{path}: its weights need three axes; {_MADE_BY}") from None
    layers = [
        *((features, inputs), (inputs, 3 * nodes), (nodes, 3 * nodes)),
        *((nodes + inputs, left), (left, answers)),
    ]
    wanted: dict[str, tuple[int, ...]] = {
        "mean": (features,),
        "scale": (features,),
        "most": (),
        "unit": (answers,),
        **{f"weights{i}": (networks, *layer) for i, layer in enumerate(layers)},
        **{f"biases{i}": (networks, 1, layer[1]) for i, layer in enumerate(layers)},
    }
    for name, shape in wanted.items():
        if data[name].shape != shape:
            raise CardboxError(
                f"{path}: {name} has the shape {data[name].shape}; expected {shape}, {_MADE_BY}"
            )
        if not np.isfinite(data[name]).all():
            raise CardboxError(f"{path}: {name} has values that are not finite; {_MADE_BY}")
    if not (data["scale"] > 0.0).all():
        raise CardboxError(f"{path}: scale has values of 0 or less; {_MADE_BY}")


def _arrays(file: Path | BinaryIO, kind: type[np.floating[Any]]) -> dict[str, FloatArray]:
    with np.load(file) as stored:
        names = [name for name in stored.files if name != "about"]
        return {name: np.asarray(stored[name], kind) for name in names}
