"""Small networks: what they answer."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.networks import Network, RecurrentNetwork

NODES, ENTERED = 4, 5


def test_the_network_averages_layers_with_rectified_inputs() -> None:
    # Two networks of one input: max(0, 2 x) + 1 and max(0, -x) - 1, in units of 0.1 m.
    network = Network(
        np.array([1.0]),
        np.array([2.0]),
        3.0,
        (np.array([[[2.0]], [[-1.0]]]), np.ones((2, 1, 3))),
        (np.zeros((2, 1, 1)), np.array([[[1.0] * 3], [[-1.0] * 3]])),
        np.array([0.1, 0.1, 0.2]),
    )
    # x = (5 - 1) / 2 = 2: (4 + 1 + 0 - 1) / 2 = 2; (-99 - 1) / 2 counts as -3: (0 + 1 + 3 - 1) / 2.
    found = network(np.array([[5.0], [-99.0]]))
    assert np.allclose(found, [[0.2, 0.2, 0.4], [0.15, 0.15, 0.3]])


def recurrent(rng: np.random.Generator, networks: int = 2) -> RecurrentNetwork:
    """A network of 3 features and 2 answers with random weights."""

    def layer(inputs: int, outputs: int) -> tuple[np.ndarray, np.ndarray]:
        shape = networks, inputs, outputs
        return rng.standard_normal(shape), rng.standard_normal((networks, 1, outputs))

    return RecurrentNetwork(
        np.zeros(3),
        np.ones(3),
        2.5,
        layer(3, ENTERED),
        layer(ENTERED, 3 * NODES),
        layer(NODES, 3 * NODES),
        (layer(NODES + ENTERED, 6), layer(6, 2)),
        np.array([0.1, 0.2]),
    )


def test_the_hidden_state_by_hand() -> None:
    """One node: half of the new value enters, and the gate for what was before is open."""
    ones, nothing = np.ones((1, 1, 1)), np.zeros((1, 1, 1))
    # To reset, update, candidate: only the candidate sees the feature and, half, the hidden.
    gru_input = np.array([[[0.0, 0.0, 1.0]]]), np.zeros((1, 1, 3))
    gru_hidden = np.array([[[0.0, 0.0, 1.0]]]), np.zeros((1, 1, 3))
    only_hidden = np.array([[[1.0], [0.0]]]), nothing
    network = RecurrentNetwork(
        np.zeros(1),
        np.ones(1),
        2.5,
        (ones, nothing),
        gru_input,
        gru_hidden,
        (only_hidden, (ones, nothing)),
        np.array([10.0]),
    )
    answers, spread, hidden = network(np.array([[0.5]]), network.initial_hidden(1))
    assert spread == pytest.approx(0.0)
    first = 0.5 * np.tanh(0.5)
    assert hidden == pytest.approx(first) and answers == pytest.approx(10.0 * first)
    answers, _, hidden = network(np.array([[0.5]]), hidden)
    second = 0.5 * np.tanh(0.5 + 0.5 * first) + 0.5 * first
    assert hidden == pytest.approx(second) and answers == pytest.approx(10.0 * second)


def test_rows_and_networks_do_not_mix() -> None:
    rng = np.random.default_rng(0)
    network = recurrent(rng)
    features = rng.standard_normal((3, 5, 3))
    hidden = network.initial_hidden(5)
    alone = network.initial_hidden(1)
    for row in features:
        answers, _, hidden = network(row, hidden)
        one, _, alone = network(row[2:3], alone)
    assert np.allclose(answers[2], one[0])
    singles = []
    for i in (0, 1):
        layers = [(w[i : i + 1], b[i : i + 1]) for w, b in (*network[3:6], *network.output_layers)]
        single = network._replace(
            input_layer=layers[0],
            gru_input=layers[1],
            gru_hidden=layers[2],
            output_layers=(layers[3], layers[4]),
        )
        hidden = single.initial_hidden(5)
        for row in features:
            found, _, hidden = single(row, hidden)
        singles.append(found)
    assert np.allclose(answers, np.mean(singles, axis=0))


def test_features_far_from_the_mean_count_as_the_most() -> None:
    network = recurrent(np.random.default_rng(1))
    far, most = np.array([[1e6, -1e6, 0.0]]), np.array([[2.5, -2.5, 0.0]])
    found, expected = (network(f, network.initial_hidden(1))[0] for f in (far, most))
    assert np.array_equal(found, expected) and np.isfinite(found).all()
