"""Learned deviations: one for each angle, arms alike, larger where the particles disagree."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture, state_limits
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.deviations import DATA, deviations_of
from cardbox_tracker.estimation.filtering.networks import Network, load_network
from cardbox_tracker.estimation.filtering.result_features import Viewpoints, features_of
from cardbox_tracker.vision.camera import Camera

STATE_LIMITS = state_limits(2.3)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
UNIT = np.ones(7)
VIEWPOINTS = Viewpoints.of(0.0, [0.0], is_measured=True)
STATES = st.lists(st.floats(0.0, 1.0), min_size=14, max_size=14).map(
    lambda shares: STATE_LIMITS[:, 0] + np.array(shares) * np.ptp(STATE_LIMITS, axis=1)
)


def deviations(state: np.ndarray, spread: float, iou: float = 0.9) -> np.ndarray:
    points = COST.keypoints(state)[None]
    row = state[None], np.full((1, 14), spread), points, np.array([iou])
    return deviations_of(load_network(DATA), features_of(*row, VIEWPOINTS))[0]


def test_the_torso_is_the_mean_of_what_is_said_beside_either_arm() -> None:
    left, right = np.array([[1.0, 2, 3, 4, 5, 6, 7], [3.0, 2, 1, 14, 15, 16, 17]]) / 20
    # A network that passes its seven features on.
    same = Network(np.zeros(7), np.ones(7), 9.0, (np.eye(7)[None],), (np.zeros((1, 1, 7)),), UNIT)
    found = deviations_of(same, np.log([[left, right]]))
    assert np.allclose(20 * found, [[2, 2, 2, 4, 5, 6, 7, 14, 15, 16, 17]])


@settings(max_examples=50, deadline=None)
@given(STATES, st.floats(0.0, 10.0), st.floats(0.0, 1.0))
def test_whatever_the_state_deviations_are_within_limits(
    state: np.ndarray, spread: float, iou: float
) -> None:
    found = deviations(state, spread, iou)
    assert found.shape == (11,)
    assert (found >= 0.01).all() and (found <= 1.5).all()


def test_particles_that_disagree_and_a_poor_fit_make_them_larger() -> None:
    state = np.append(reference_posture("arms"), [0.0, 0.0])
    sure = deviations(state, 0.05, 0.92)
    assert deviations(state, 0.3, 0.92).mean() > sure.mean()
    assert deviations(state, 0.05, 0.6).mean() > sure.mean()
