"""The packed network answers as the network does whose weights it has."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.correction import DATA
from cardbox_tracker.estimation.filtering.networks import RecurrentNetwork, load_recurrent_network
from cardbox_tracker.estimation.filtering.packed_network import PackedNetwork

FEATURES, ENTERED, NODES, ANSWERS = 7, 5, 6, 3
# Rounding of a weight by its largest neighbour's 2^-16, over a few dozen products.
CLOSE = 2e-3


def network(rng: np.random.Generator, networks: int = 3) -> RecurrentNetwork:
    """A network with random weights; one input of the first layer has no weights."""

    def layer(inputs: int, outputs: int) -> tuple[np.ndarray, np.ndarray]:
        weights = rng.standard_normal((networks, inputs, outputs)).astype(np.float32)
        return weights, rng.standard_normal((networks, 1, outputs)).astype(np.float32)

    first = layer(FEATURES, ENTERED)
    first[0][:, 2] = 0.0
    return RecurrentNetwork(
        rng.standard_normal(FEATURES).astype(np.float32),
        rng.uniform(0.5, 2.0, FEATURES).astype(np.float32),
        2.5,
        first,
        layer(ENTERED, 3 * NODES),
        layer(NODES, 3 * NODES),
        (layer(NODES + ENTERED, 4), layer(4, ANSWERS)),
        rng.uniform(0.1, 1.0, ANSWERS).astype(np.float32),
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_answers_are_those_of_the_network(seed: int) -> None:
    rng = np.random.default_rng(seed)
    usual = network(rng)
    packed = PackedNetwork(usual)
    hidden = expected_hidden = usual.initial_hidden(2)
    for _ in range(30):
        features = 2.0 * rng.standard_normal((2, FEATURES))
        answers, spread, hidden = packed(features, hidden)
        expected, expected_spread, expected_hidden = usual(features, expected_hidden)
        assert np.abs(hidden - expected_hidden).max() < CLOSE
        scale = np.abs(expected).max() + expected_spread.max()
        assert np.abs(answers - expected).max() < CLOSE * scale
        assert np.abs(spread - expected_spread).max() < CLOSE * scale


def test_the_shipped_network_loses_less_than_a_thousandth() -> None:
    usual = load_recurrent_network(DATA)
    packed = PackedNetwork(usual)
    rng = np.random.default_rng(0)
    hidden = expected_hidden = usual.initial_hidden(2)
    for _ in range(50):
        features = rng.normal(usual.mean, usual.scale, (2, len(usual.mean)))
        answers, spread, hidden = packed(features, hidden)
        expected, expected_spread, expected_hidden = usual(features, expected_hidden)
        for one, other in ((answers, expected), (spread, expected_spread)):
            assert np.abs(one - other).max() < 1e-3 * np.abs(expected).max()


def test_the_same_features_have_the_same_bytes() -> None:
    usual = load_recurrent_network(DATA)
    features = np.random.default_rng(1).normal(usual.mean, usual.scale, (2, len(usual.mean)))
    found = [PackedNetwork(usual)(features, usual.initial_hidden(2)) for _ in range(2)]
    for one, other in zip(*found, strict=True):
        assert one.tobytes() == other.tobytes()


def test_rows_do_not_mix() -> None:
    rng = np.random.default_rng(2)
    usual = network(rng)
    packed, hidden = PackedNetwork(usual), usual.initial_hidden(2)
    features = rng.standard_normal((2, FEATURES))
    answers, *_ = packed(features, hidden)
    features[1] = rng.standard_normal(FEATURES)
    again, *_ = packed(features, hidden)
    assert np.allclose(answers[0], again[0], rtol=1e-6)
    assert not np.allclose(answers[1], again[1])


def test_large_values_saturate() -> None:
    rng = np.random.default_rng(3)
    usual = network(rng)
    weights, biases = usual.gru_input
    packed = PackedNetwork(usual._replace(gru_input=(1e4 * weights, 1e4 * biases)))
    _, _, hidden = packed(rng.standard_normal((2, FEATURES)), usual.initial_hidden(2))
    assert np.isfinite(hidden).all() and np.abs(hidden).max() <= 1.0 + 1e-6


def test_other_shapes_are_refused() -> None:
    usual = network(np.random.default_rng(4))
    packed, hidden = PackedNetwork(usual), usual.initial_hidden(2)
    with pytest.raises(ValueError, match="features has the shape"):
        packed(np.zeros((2, FEATURES + 1)), hidden)
    with pytest.raises(ValueError, match="hidden has the shape"):
        packed(np.zeros((2, FEATURES)), usual.initial_hidden(3))
