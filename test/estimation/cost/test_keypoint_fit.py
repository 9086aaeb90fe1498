"""Gauss-Newton steps bring keypoints to where they are wanted."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
BEGIN = np.append(reference_posture("arms"), [0.0, 0.0])
BEGIN[[5, 7, 9, 11]] = 0.3
STDDEV = np.full(14, 0.3)


def fitted(wanted: np.ndarray, stddev: np.ndarray = STDDEV, steps: int = 4) -> np.ndarray:
    state = BEGIN.copy()
    skeleton = COST.parts, COST.girdle, COST.place, COST.view
    fit_keypoints(state, *skeleton, wanted, stddev, STATE_LIMITS, STATE_STEP, steps)
    return state


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-0.15, 0.15), min_size=14, max_size=14))
def test_it_reaches_what_a_near_state_has(off: list[float]) -> None:
    wanted = COST.keypoints(np.clip(BEGIN + off, *STATE_LIMITS.T))
    apart = COST.keypoints(fitted(wanted)) - wanted
    assert np.linalg.norm(apart, axis=1).max() < 0.01


def test_what_may_not_move_stays() -> None:
    wanted = COST.keypoints(BEGIN) + np.array([0.0, 0.0, 0.05])
    only_place = np.array([0.1, *[0.0] * 11, 0.1, 0.1])
    found = fitted(wanted, only_place)
    assert np.array_equal(found[1:12], BEGIN[1:12])
    # 5 cm farther away from a level camera.
    assert np.allclose(found - BEGIN, [*[0.0] * 12, -0.05, 0.0], atol=1e-3)


def test_limits_hold() -> None:
    wanted = COST.keypoints(BEGIN) + np.array([0.0, 0.0, 5.0])
    found = fitted(wanted)
    assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()


def test_equations_are_solved() -> None:
    rng = np.random.default_rng(0)
    half = rng.standard_normal((6, 6))
    matrix, right = half @ half.T + np.eye(6), rng.standard_normal(6)
    expected = np.linalg.solve(matrix, right)
    solve(matrix, right)
    assert np.allclose(right, expected)
