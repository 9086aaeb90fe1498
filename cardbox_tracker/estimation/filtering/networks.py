"""Small neural networks that were learned from recordings, and the data files they are in."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit

Layer = tuple[FloatArray, FloatArray]
"""Weights (networks, inputs, outputs) and biases (networks, 1, outputs)."""

Read = TypeVar("Read")


class Network(NamedTuple):
    """Some networks of the same shape, whose answers are averaged.

    Attributes:
        mean: of the features, (F,).
        scale: their deviations, (F,).
        most: scaled features beyond this count as this.
        weights: of each layer, (networks, inputs, outputs).
        biases: of each layer, (networks, 1, outputs).
        unit: of the answers, (A,).
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    unit: FloatArray

    def __call__(self, features: FloatArray) -> FloatArray:
        """Return the answers, (n, A), to features (n, F)."""
        scaled = scaled_features(features, self.mean, self.scale, self.most)
        answers = np.zeros((len(features), len(self.unit)))
        # For two rows the layers of numpy's products take longer than the products.
        _add_answers(scaled, self.weights, self.biases, answers)
        answers *= self.unit / len(self.weights[0])
        return answers


class RecurrentNetwork(NamedTuple):
    """Some networks of the same shape with a memory, whose answers are averaged.

    A layer, a gated recurrent unit with ``nodes`` values (Cho et al. 2014, in the form of cuDNN,
    where the reset gate acts after the product), and two layers that see both:

        v = relu(enter(scaled features))
        r, u = sigmoid of the first two parts of receive(v) + keep(memory)
        candidate = tanh(third part of receive(v) + r * third part of keep(memory))
        memory = (1 - u) candidate + u memory
        answers = leave_1(relu(leave_0([memory, v])))

    Attributes:
        mean: of the features, (F,).
        scale: their deviations, (F,).
        most: scaled features beyond this count as this.
        enter: weights (networks, F, entered) and biases (networks, 1, entered).
        receive: the same, (networks, entered, 3 nodes).
        keep: the same, (networks, nodes, 3 nodes).
        leave: the same of the last two layers.
        unit: of the answers, (A,).
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    enter: Layer
    receive: Layer
    keep: Layer
    leave: tuple[Layer, Layer]
    unit: FloatArray

    def new_memory(self, rows: int) -> FloatArray:
        """Return the memory, (networks, rows, nodes), of somebody who was not seen before."""
        weights = self.keep[0]
        return np.zeros((len(weights), rows, weights.shape[1]), weights.dtype)

    def __call__(self, features: FloatArray, memory: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the answers, (rows, A), to features (rows, F), and the next memory."""
        nodes = memory.shape[2]
        scaled = scaled_features(features, self.mean, self.scale, self.most)
        entered = np.maximum(scaled.astype(memory.dtype) @ self.enter[0] + self.enter[1], 0.0)
        received = entered @ self.receive[0] + self.receive[1]
        kept = memory @ self.keep[0] + self.keep[1]
        gates = _sigmoid(received[..., : 2 * nodes] + kept[..., : 2 * nodes])
        reset, update = gates[..., :nodes], gates[..., nodes:]
        candidate = np.tanh(received[..., 2 * nodes :] + reset * kept[..., 2 * nodes :])
        memory = candidate + update * (memory - candidate)
        (first, first_biases), (last, last_biases) = self.leave
        inside = np.concatenate([memory, entered], axis=2) @ first + first_biases
        answers = np.maximum(inside, 0.0) @ last + last_biases
        return np.asarray(answers.mean(axis=0), np.float64) * self.unit, memory


@njit(cache=True, nogil=True, error_model="numpy")
def _add_answers(
    features: FloatArray,
    weights: tuple[FloatArray, ...],
    biases: tuple[FloatArray, ...],
    answers: FloatArray,
) -> None:
    """Add the answers of all networks of a :class:`Network`, without the unit, to (n, A)."""
    for network in range(weights[0].shape[0]):
        for row in range(features.shape[0]):
            values = features[row]
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
                answers[row, o] += values[o]


def scaled_features(
    features: FloatArray, mean: FloatArray, scale: FloatArray, most: float
) -> FloatArray:
    """Return features (..., F) beside their ``mean`` in units of ``scale``, at most ``most``."""
    scaled: FloatArray = np.clip((features - mean) / scale, -most, most)
    return scaled


def _sigmoid(values: FloatArray) -> FloatArray:
    # Without an overflow, whatever the value.
    result: FloatArray = 0.5 * (1.0 + np.tanh(0.5 * values))
    return result


@cache
def load_network(name: str) -> Network:
    """Return the network of the package in the data file ``name``."""
    return _packaged(name, read_network)


@cache
def load_recurrent_network(name: str) -> RecurrentNetwork:
    """Return the network with a memory of the package in the data file ``name``."""
    return _packaged(name, read_recurrent_network)


def _packaged(name: str, read: Callable[[Path], Read]) -> Read:
    with resources.as_file(resources.files(__package__).joinpath(name)) as path:
        return read(path)


def read_network(path: Path) -> Network:
    """Return the network in a file that ``tools/networks.py`` has written."""
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
    """Return the network with a memory in a file that ``tools/networks.py`` has written."""
    data = _arrays(path, np.float32)
    enter, receive, keep, first, last = (
        (data[f"weights{i}"], data[f"biases{i}"]) for i in range(5)
    )
    most = float(data["most"])
    return RecurrentNetwork(
        data["mean"], data["scale"], most, enter, receive, keep, (first, last), data["unit"]
    )


def _arrays(path: Path, kind: type[np.floating[Any]]) -> dict[str, FloatArray]:
    with np.load(path) as stored:
        names = [name for name in stored.files if name != "about"]
        return {name: np.asarray(stored[name], kind) for name in names}
