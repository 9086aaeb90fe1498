"""What a depth image says of shoulder, elbow and hand, and when it says nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.filtering.depth_features import (
    DEPTH_FEATURES,
    features_of_depth,
)
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
LEFT = [[0.2, 0.0, 2.0], [0.2, 0.3, 2.0], [0.2, 0.5, 1.8]]
RIGHT = [[-0.2, 0.0, 2.0], [-0.2, 0.3, 2.0], [-0.2, 0.5, 1.8]]
POINTS = np.array([*LEFT, *RIGHT])
EVERYWHERE = np.full((240, 320), 255, np.uint8)


def frame(depth_m: float) -> Frame:
    depth = np.full(EVERYWHERE.shape, depth_m, np.float32)
    return Frame(EVERYWHERE, 240, EVERYWHERE.size, depth_m=depth)


def test_the_surface_is_compared_with_the_joints() -> None:
    features = features_of_depth(frame(1.9), CAMERA, POINTS)
    assert features.shape == (2, DEPTH_FEATURES)
    assert np.allclose(features, [-0.1, -0.1, 0.1, 1.0, 1.0, 1.0])


def test_a_row_for_each_arm() -> None:
    seen = frame(1.9)
    assert seen.depth_m is not None
    # The left hand is at column 159.5 + 300 * 0.2 / 1.8 = 193 and row 203.
    seen.depth_m[195:210, 185:200] = 1.7
    left, right = features_of_depth(seen, CAMERA, POINTS)
    assert np.allclose(left[:3], [-0.1, -0.1, -0.1])
    assert np.allclose(right[:3], [-0.1, -0.1, 0.1])


def test_outliers_the_wall_and_what_was_not_measured_do_not_count() -> None:
    seen = frame(1.9)
    assert seen.depth_m is not None
    seen.depth_m[::2] = 3.5
    seen.depth_m[1::4] = 0.0
    seen.depth_m[:, ::9] = np.nan
    assert np.allclose(features_of_depth(seen, CAMERA, POINTS)[0, :3], [-0.1, -0.1, 0.1])
    nobody = replace(frame(1.9), silhouette=np.zeros_like(EVERYWHERE))
    for nothing in (frame(0.0), frame(3.5), nobody, replace(nobody, depth_m=None)):
        assert not features_of_depth(nothing, CAMERA, POINTS).any()


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-3.0, 3.0), min_size=18, max_size=18), st.floats(0.0, 5.0))
def test_wherever_the_joints_are_it_is_finite_and_limited(
    places: list[float], depth_m: float
) -> None:
    features = features_of_depth(frame(depth_m), CAMERA, np.reshape(places, (6, 3)))
    assert np.abs(features[:, :3]).max() <= 0.3
    assert set(features[:, 3:].ravel()) <= {0.0, 1.0}
