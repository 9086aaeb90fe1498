"""Small networks: what they answer."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.estimation.filtering.networks import Network


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
