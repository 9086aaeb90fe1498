"""Whoever is nearer than a limit is cut out, whatever the depth camera did not see."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.segmentation.silhouettes import silhouette_within

H, W = 240, 320


def person() -> np.ndarray:
    """Somebody at 2 m before a wall at 3.5 m."""
    depth_m = np.full((H, W), 3.5, np.float32)
    depth_m[60:220, 120:200] = 2.0
    return depth_m


def test_who_is_nearer_than_the_limit_is_cut_out() -> None:
    depth_m = person()
    silhouette = silhouette_within(depth_m, 2.8)
    assert silhouette.dtype == np.uint8
    assert np.array_equal(silhouette > 0, depth_m < 2.8)
    assert not silhouette_within(depth_m, 1.5).any()
    assert silhouette_within(depth_m, 4.0).all()


def test_gaps_specks_and_holes_are_mended() -> None:
    depth_m = person()
    expected = depth_m < 2.8
    # An arm before the chest hides a strip of it from one of the camera's eyes.
    depth_m[100:180, 150:153] = 0.0
    depth_m[80:90, 130:132] = np.nan
    depth_m[20, 20] = 1.0
    assert np.array_equal(silhouette_within(depth_m, 2.8) > 0, expected)


def test_what_is_unknown_beside_the_person_is_not_theirs() -> None:
    depth_m = person()
    expected = depth_m < 2.8
    depth_m[:, 200:230] = 0.0
    assert np.array_equal(silhouette_within(depth_m, 2.8) > 0, expected)
    assert not silhouette_within(np.zeros((H, W), np.float32), 2.8).any()


@given(st.floats(0.5, 5.0), st.floats(0.5, 5.0))
def test_a_farther_limit_cuts_out_more(one_m: float, other_m: float) -> None:
    depth_m = np.linspace(0.5, 5.0, H * W, dtype=np.float32).reshape(H, W)
    near, far = sorted((one_m, other_m))
    inside, outside = silhouette_within(depth_m, near), silhouette_within(depth_m, far)
    assert not np.any((inside > 0) & (outside == 0))
