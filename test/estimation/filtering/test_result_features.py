"""What learned networks see of a result: arms alike."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import state_limits
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.result_features import (
    FEATURES,
    OF_CAMERAS,
    Viewpoints,
    features_of,
)
from cardbox_tracker.vision.camera import Camera

STATE_LIMITS = state_limits(2.3)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
VIEWPOINTS = Viewpoints(0.25, 1.0, 0.5, 0.2, is_measured=True)
STATES = st.lists(st.floats(0.0, 1.0), min_size=14, max_size=14).map(
    lambda shares: STATE_LIMITS[:, 0] + np.array(shares) * np.ptp(STATE_LIMITS, axis=1)
)


def mirrored(points: np.ndarray) -> np.ndarray:
    """Keypoints (6, 3) as in a mirror beside the camera."""
    return points[[3, 4, 5, 0, 1, 2]] * (-1.0, 1.0, 1.0)


def test_bones_hand_state_deviations_and_the_rest() -> None:
    # The left arm hangs, its forearm points at the camera; the right one points aside.
    left = [0.2, 0, 2.0], [0.2, 0.3, 2.0], [0.2, 0.3, 1.8]
    right = [-0.2, 0, 2.0], [-0.5, 0, 2.0], [-0.7, 0, 2.0]
    points, state, stddev = np.array([[*left, *right]]), np.arange(14.0), 0.1 * np.arange(14.0)
    both = features_of(state[None], stddev[None], points, np.array([0.9]), VIEWPOINTS)
    assert both.shape == (1, 2, FEATURES)
    bones, aside = [0, 1, 0, 0, 0, -1], [-1, 0, 0, -1, 0, 0]
    squares = np.square([*bones, *aside])
    hand = np.array([0.2, 0.3, -0.2])
    expected = [*bones, *aside, *squares, *hand, *hand**2, 0.2, *state, *stddev]
    expected += [0.9, 3.0, 0.25, 1.0, 0.5, 0.2, 1.0, 0.0]
    assert np.allclose(both[0, 0], expected)
    # In the mirror the right arm points to the other side, and the left one hangs as before.
    assert np.allclose(both[0, 1, :12], [1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, -1])
    assert np.allclose(both[0, 1, 24:27], [0.7, 0, 0])
    # A further camera is on the other side, too.
    assert np.allclose(both[0, 1, OF_CAMERAS], [1.0, 0.5, -0.2, 1.0, 0.0])


def test_cameras_show_what_lies_across_their_lines_of_sight() -> None:
    alone = Viewpoints.of(0.1, [0.0], is_measured=True)
    assert alone == (0.1, 1.0, 0.0, 0.0, True, False)
    # 30 degrees to a side show a quarter of the depth, 90 degrees all of it.
    assert np.allclose(Viewpoints.of(0.1, [np.radians(30)], True)[1:4], [0.75, 0.25, 0.75**0.5 / 2])
    assert np.allclose(Viewpoints.of(0.1, [0.0, np.pi / 2], False), [0.1, 1.0, 1.0, 0.0, 0.0, 0.0])
    right, left = (Viewpoints.of(0.0, [0.0, yaw], True) for yaw in (0.5, -0.5))
    assert right.slanting == -left.slanting != 0.0


@settings(max_examples=50, deadline=None)
@given(STATES)
def test_the_right_arm_is_seen_as_a_left_one(state: np.ndarray) -> None:
    other = state[[0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13]]
    other = other * [-1, -1, 1, -1, *[1] * 10]
    stddev = np.linspace(0.1, 0.2, 14)
    points, iou = COST.keypoints(state), np.array([0.9])
    features = features_of(state[None], stddev[None], points[None], iou, VIEWPOINTS)
    there = features_of(
        other[None],
        stddev[None, [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13]],
        mirrored(points)[None],
        iou,
        VIEWPOINTS._replace(slanting=-VIEWPOINTS.slanting),
    )
    assert np.allclose(features[0, ::-1], there[0])
