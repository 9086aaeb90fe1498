"""What is learned of depth moves joints in depth, arms alike, and bones keep their lengths."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.estimation.filtering.depth_correction import (
    DATA,
    DepthCorrection,
    missing_depth,
    moved_in_depth,
)
from cardbox_tracker.estimation.filtering.networks import load_network
from cardbox_tracker.estimation.filtering.result_features import features_of
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
ARMS = [1, 2, 4, 5]
PARENTS = [0, 1, 3, 4]
STATES = st.lists(st.floats(0.0, 1.0), min_size=14, max_size=14).map(
    lambda shares: STATE_LIMITS[:, 0] + np.array(shares) * np.ptp(STATE_LIMITS, axis=1)
)


def bones_of(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[..., ARMS, :] - points[..., PARENTS, :], axis=-1)


def test_missing_depth_is_what_the_truth_is_farther_away() -> None:
    found = np.zeros((1, 6, 3))
    true = found.copy()
    # Shoulders 2 and 4 cm farther away; left elbow 5, left hand 10; right ones 3 and -7.
    true[0, :, 2] = 0.02, 0.05, 0.10, 0.04, 0.03, -0.07
    assert np.allclose(missing_depth(found, true), [[[0.03, 0.02, 0.07], [0.03, 0.0, -0.10]]])


def test_a_bone_across_the_image_turns_and_keeps_its_length() -> None:
    points = np.array([[[0.2, 0, 2], [0.5, 0, 2], [0.5, 0.3, 2], [-0.2, 0, 2], *[[0, 0, 0]] * 2]])
    points[0, 4:] = [-0.5, 0, 2], [-0.8, 0, 2]
    moved = moved_in_depth(points, np.array([[[0.0, 0.18, 0.18], [0.0, 0.0, 0.0]]]))[0]
    # 30 cm of bone with 18 cm of depth leave 24 cm across: 3, 4, 5.
    assert np.allclose(moved[1], [0.44, 0, 2.18])
    assert np.allclose(moved[2], [0.44, 0.3, 2.18])
    assert np.allclose(moved[3:], points[0, 3:])


def test_the_shoulders_move_along_their_line_of_sight() -> None:
    points = COST.keypoints(FRONT)[None]
    moved = moved_in_depth(points, np.array([[[0.1, 0, 0], [0.1, 0, 0]]]))
    middle, then = (p[0, (0, 3)].mean(axis=0) for p in (points, moved))
    assert then[2] == pytest.approx(middle[2] + 0.1)
    assert np.allclose(then[:2] / then[2], middle[:2] / middle[2])


@settings(max_examples=50, deadline=None)
@given(STATES, st.lists(st.floats(-0.5, 0.5), min_size=6, max_size=6))
def test_bones_keep_their_lengths(state: np.ndarray, missing: list[float]) -> None:
    points = COST.keypoints(state)[None]
    moved = moved_in_depth(points, np.reshape(missing, (1, 2, 3)))
    assert np.allclose(bones_of(moved), bones_of(points))


@settings(max_examples=50, deadline=None)
@given(STATES, st.floats(0.0, 1.0))
def test_whatever_the_state_the_result_is_finite_and_near(state: np.ndarray, iou: float) -> None:
    found = DepthCorrection(COST, 1.0)(state, np.full(14, 0.2), iou)
    assert np.isfinite(found).all()
    assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()
    assert np.array_equal(found[1:4], state[1:4])
    apart = np.linalg.norm(COST.keypoints(found) - COST.keypoints(state), axis=1)
    assert apart.max() < 1.2


def test_results_come_near_the_wanted_depth() -> None:
    """The two steps reach what the network says, but for what joints cannot do."""
    state, stddev = FRONT.copy(), np.full(14, 0.1)
    # Where a joint is at its limit, such as a straight elbow, it cannot go on.
    state[[7, 11]] = 0.6
    points = COST.keypoints(state)
    features = features_of(state[None], stddev[None], points[None], np.array([0.9]), 0.0)
    wanted = moved_in_depth(points[None], load_network(DATA)(features[0])[None])[0]
    found = COST.keypoints(DepthCorrection(COST, 1.0)(state, stddev, 0.9))
    off, before = (np.linalg.norm(p - wanted, axis=1).mean() for p in (found, points))
    assert off < 0.5 * before


def test_corrections_are_smoothed_and_forgotten() -> None:
    first, second = FRONT, np.append(reference_posture("arms"), [0.0, 0.0])
    stddev = np.full(14, 0.1)
    alone = DepthCorrection(COST, 1.0)(second, stddev, 0.9)
    correction = DepthCorrection(COST, 1.0)
    correction(first, stddev, 0.5)
    after = correction(second, stddev, 0.9)
    assert not np.allclose(after, alone)
    correction.forget()
    assert np.array_equal(correction(second, stddev, 0.9), alone)
