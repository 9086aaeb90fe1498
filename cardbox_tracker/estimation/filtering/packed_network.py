"""A recurrent network with packed weights, which answers for both arms in one compiled call.

A frame's other work displaces the weights from the processor's cache, so a call waits for them. As
whole numbers of 16 bits with one factor for each input they need half the memory, and the answers
change by less than a thousandth. Inputs that are zero for both arms, as many are after a rectifier,
need no weights at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import inlined_kernel, njit
from cardbox_tracker.estimation.filtering.networks import Layer, RecurrentNetwork
from cardbox_tracker.vision.array_checks import check_array

ROWS = 2
"""Rows of features of a call: the left and the mirrored right arm."""

Singles = NDArray[np.float32]
PackedLayer = tuple[NDArray[np.int16], Singles, Singles]
"""Weights (networks, inputs, outputs), their factors (networks, inputs), biases."""
PackedLayers = tuple[PackedLayer, PackedLayer, PackedLayer, PackedLayer, PackedLayer]

_MOST = np.iinfo(np.int16).max
# Inputs whose products are added in one pass over the outputs.
_AT_ONCE = 4
_ZERO, _QUARTER, _HALF, _ONE, _TWO = (np.float32(one) for one in (0.0, 0.25, 0.5, 1.0, 2.0))
# From here on the hyperbolic tangent is 1 in 32 bits.
_LARGE = np.float32(9.0)
# With an unsigned index, numba compiles no code for negative indices.
_index = np.uint64
_quick = njit(fastmath={"contract"})


class PackedNetwork:
    """A :class:`~.networks.RecurrentNetwork` for two rows of features, with packed weights."""

    def __init__(self, network: RecurrentNetwork) -> None:
        """Pack the weights of ``network``."""
        self._scaling = network.mean, network.scale, network.most
        layers = network.input_layer, network.gru_input, network.gru_hidden, *network.output_layers
        first, second, third, fourth, last = (_packed(layer) for layer in layers)
        self._layers: PackedLayers = first, second, third, fourth, last
        self._unit = network.unit
        networks, self._features, _ = network.input_layer[0].shape
        self._hidden = networks, ROWS, network.gru_hidden[0].shape[1]
        self._answers = networks, ROWS, len(network.unit)
        self._work = _work_for(self._layers)

    def initial_hidden(self) -> Singles:
        """Return the hidden state, (networks, 2, nodes), before the first frame."""
        return np.zeros(self._hidden, np.float32)

    def __call__(
        self, features: FloatArray, hidden: Singles
    ) -> tuple[FloatArray, FloatArray, Singles]:
        """Return the answers to features (2, F), and the next hidden state.

        Returns:
            Mean (2, A) and standard deviation (2, A) of the networks' answers; hidden state.

        Raises:
            ValueError: features or hidden state have another shape or type.
        """
        check_array("features", features, (ROWS, self._features), np.float64)
        check_array("hidden", hidden, self._hidden, np.float32)
        after, answers = np.empty_like(hidden), np.empty(self._answers, np.float32)
        _answer(features, self._scaling, self._layers, self._work, hidden, after, answers)
        mean, spread = np.empty((2, *self._answers[1:]))
        _average(answers, self._unit, mean, spread)
        return mean, spread, after


WorkTuple = tuple[Singles, Singles, Singles, Singles, Singles, Singles, NDArray[np.int64], Singles]


def _work_for(layers: PackedLayers) -> WorkTuple:
    """Allocate the scratch arrays of :func:`_answer`."""
    (features, inputs), (_, gates), _, (both, last), _ = (one[0].shape[1:] for one in layers)
    most = max(one[0].shape[1] for one in layers) + _AT_ONCE

    def rows(width: int) -> Singles:
        return np.empty((ROWS, width), np.float32)

    first = rows(features), rows(inputs), rows(gates), rows(gates)
    return *first, rows(both), rows(last), np.empty(most, np.int64), rows(most)


def _packed(layer: Layer) -> PackedLayer:
    weights, biases = (np.asarray(one, np.float32) for one in layer)
    most = np.abs(weights).max(axis=2, keepdims=True)
    factors = np.where(most > 0.0, most / _MOST, 1.0).astype(np.float32)
    whole = np.rint(weights / factors).astype(np.int16)
    return whole, np.ascontiguousarray(factors[..., 0]), np.ascontiguousarray(biases)


@inlined_kernel
def _tanh(x: np.float32) -> np.float32:
    """Return the hyperbolic tangent by Lambert's continued fraction of x / 4, doubled twice.

    Without calls and branches, loops over it can be vectorized.
    """
    y = _QUARTER * min(max(x, -_LARGE), _LARGE)
    s = y * y
    above = np.float32(135135) + s * (np.float32(17325) + s * (np.float32(378) + s))
    below = s * (np.float32(62370) + s * (np.float32(3150) + np.float32(28) * s))
    t = y * above / (np.float32(135135) + below)
    t = _TWO * t / (_ONE + t * t)
    tangent: np.float32 = _TWO * t / (_ONE + t * t)
    return tangent


@inlined_kernel
def _sigmoid(x: np.float32) -> np.float32:
    sigmoid: np.float32 = _HALF + _HALF * _tanh(_HALF * x)
    return sigmoid


@_quick
def _answer(
    features: FloatArray,
    scaling: tuple[FloatArray, FloatArray, float],
    layers: PackedLayers,
    work: WorkTuple,
    hidden: Singles,
    after: Singles,
    answers: Singles,
) -> None:
    """Write the next hidden state and the answers (networks, 2, A) of a packed network.

    :class:`~.networks.RecurrentNetwork` has the formulas.
    """
    mean, scale, most = scaling
    input_layer, gru_input, gru_hidden, first, final = layers
    scaled, inputs, of_input, of_hidden, both, last, active, values = work
    nodes = hidden.shape[2]
    for row in range(ROWS):
        for i in range(scaled.shape[1]):
            value = (features[row, i] - mean[i]) / scale[i]
            scaled[row, i] = np.float32(min(max(value, -most), most))
    for network in range(hidden.shape[0]):
        _apply(scaled, input_layer, network, inputs, active, values)
        _rectify(inputs)
        _apply(inputs, gru_input, network, of_input, active, values)
        _apply(hidden[network], gru_hidden, network, of_hidden, active, values)
        for row in range(ROWS):
            there, here, now = of_hidden[row], of_input[row], both[row]
            before, kept = hidden[network, row], after[network, row]
            for i in range(nodes):
                k, m, n = _index(i), _index(i + nodes), _index(i + 2 * nodes)
                reset = _sigmoid(here[k] + there[k])
                update = _sigmoid(here[m] + there[m])
                candidate = _tanh(here[n] + reset * there[n])
                value = candidate + update * (before[k] - candidate)
                kept[k] = value
                now[k] = value
            for i in range(inputs.shape[1]):
                now[nodes + i] = inputs[row, i]
        _apply(both, first, network, last, active, values)
        _rectify(last)
        _apply(last, final, network, answers[network], active, values)


@_quick
def _apply(
    inputs: Singles,
    layer: PackedLayer,
    network: int,
    outputs: Singles,
    active: NDArray[np.int64],
    values: Singles,
) -> None:
    """Write the outputs (2, O) of one network's layer for inputs (2, I)."""
    weights, factors, biases = layer[0][network], layer[1][network], layer[2][network, 0]
    count = 0
    for i in range(weights.shape[0]):
        if inputs[0, i] != _ZERO or inputs[1, i] != _ZERO:
            active[count] = i
            values[0, count], values[1, count] = (
                factors[i] * inputs[0, i],
                factors[i] * inputs[1, i],
            )
            count += 1
    while count % _AT_ONCE != 0:
        active[count] = 0
        values[0, count], values[1, count] = _ZERO, _ZERO
        count += 1
    one, other = outputs[0], outputs[1]
    for o in range(weights.shape[1]):
        one[o], other[o] = biases[o], biases[o]
    for j in range(0, count, _AT_ONCE):
        w0, w1 = weights[active[j]], weights[active[j + 1]]
        w2, w3 = weights[active[j + 2]], weights[active[j + 3]]
        a0, a1, a2, a3 = values[0, j], values[0, j + 1], values[0, j + 2], values[0, j + 3]
        b0, b1, b2, b3 = values[1, j], values[1, j + 1], values[1, j + 2], values[1, j + 3]
        for o in range(weights.shape[1]):
            k = _index(o)
            f0, f1 = np.float32(w0[k]), np.float32(w1[k])
            f2, f3 = np.float32(w2[k]), np.float32(w3[k])
            one[k] += a0 * f0 + a1 * f1 + a2 * f2 + a3 * f3
            other[k] += b0 * f0 + b1 * f1 + b2 * f2 + b3 * f3


@inlined_kernel
def _rectify(values: Singles) -> None:
    for row in range(ROWS):
        for i in range(values.shape[1]):
            values[row, i] = max(values[row, i], _ZERO)


@_quick
def _average(answers: Singles, unit: FloatArray, mean: FloatArray, spread: FloatArray) -> None:
    """Write mean and standard deviation (2, A) over the networks, times ``unit``."""
    networks = answers.shape[0]
    for row in range(ROWS):
        for i in range(answers.shape[2]):
            total, squares = 0.0, 0.0
            for network in range(networks):
                total += answers[network, row, i]
            middle = total / networks
            for network in range(networks):
                squares += (answers[network, row, i] - middle) ** 2
            mean[row, i] = middle * unit[i]
            spread[row, i] = np.sqrt(squares / networks) * unit[i]
