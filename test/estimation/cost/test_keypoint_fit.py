"""Inverse kinematics and Gauss-Newton steps bring keypoints to where they are wanted."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture, state_limits
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints, pose_at_keypoints
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera

STATE_LIMITS = state_limits(2.3)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
BEGIN = np.append(reference_posture("arms"), [0.0, 0.0])
BEGIN[[5, 7, 9, 11]] = 0.3
STDDEV = np.full(14, 0.3)


def fitted(wanted: np.ndarray, stddev: np.ndarray = STDDEV, steps: int = 4) -> np.ndarray:
    state = BEGIN.copy()
    fit_keypoints(state, COST.body, wanted, stddev, STATE_LIMITS, STATE_STEP, steps)
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


def posed(begin: np.ndarray, wanted: np.ndarray, cost: WholeBodyCost = COST) -> np.ndarray:
    state = begin.copy()
    pose_at_keypoints(state, cost.body, wanted, STATE_LIMITS)
    return state


@settings(max_examples=100, deadline=None)
@given(shares=st.lists(st.floats(0.02, 0.98), min_size=14, max_size=14), pitch=st.floats(-0.2, 0.4))
def test_a_posture_is_found_from_its_keypoints(shares: list[float], pitch: float) -> None:
    cost = WholeBodyCost(
        BodyModel.of(distance_m=2.3, camera_pitch_rad=pitch),
        CAMERA.with_pitch(pitch),
        WholeBodyCostConfig(),
    )
    low, high = STATE_LIMITS.T
    state = low + np.array(shares) * (high - low)
    # Bent further aside than a right angle is turned round and bent less: beyond the limits.
    state[[7, 11]] = np.minimum(state[[7, 11]], np.radians(89.0))
    wanted = cost.keypoints(state)
    begin = np.zeros(14)
    # The torso keeps its angles; all else is found.
    begin[1:4] = state[1:4]
    assert np.allclose(cost.keypoints(posed(begin, wanted, cost)), wanted, atol=1e-9)


def test_a_bone_goes_to_the_nearer_limit() -> None:
    begin = BEGIN.copy()
    begin[4:12] = 0.0
    wanted = COST.keypoints(begin)
    # Inwards beyond the limit of 45 degrees, straight on from there.
    shoulder, length = wanted[0], np.linalg.norm(wanted[1] - wanted[0])
    aside = np.radians(100.0)
    for joint, reach in ((1, length), (2, np.linalg.norm(wanted[2] - wanted[0]))):
        wanted[joint] = shoulder + reach * np.array([-np.sin(aside), np.cos(aside), 0.0])
    found = posed(begin, wanted)
    assert np.isclose(found[4], STATE_LIMITS[4, 0])
    # The other arm and the torso are where they were.
    assert np.allclose(found[8:12], begin[8:12], atol=1e-6)
    assert np.array_equal(found[1:4], begin[1:4])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-2.0, 2.0), min_size=18, max_size=18))
def test_what_cannot_be_reached_stays_within_the_limits(off: list[float]) -> None:
    found = posed(BEGIN, COST.keypoints(BEGIN) + np.reshape(off, (6, 3)))
    assert np.isfinite(found).all()
    assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()


def test_equations_are_solved() -> None:
    rng = np.random.default_rng(0)
    half = rng.standard_normal((6, 6))
    matrix, right = half @ half.T + np.eye(6), rng.standard_normal(6)
    expected = np.linalg.solve(matrix, right)
    solve(matrix, right)
    assert np.allclose(right, expected)
