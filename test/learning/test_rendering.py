"""Triangles in front of a camera whose focal length and principal point are whole pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.vision.camera import Camera
from learning.rendering import Rendering, render

CAMERA = Camera(8, 6, 4.0, 4.0, 4.0, 3.0)
TOWARDS = np.array([0.0, 0.0, -1.0])
RED, GREEN = (200, 0, 0), (0, 100, 0)
CORNERS_PX = (1, 1), (5, 1), (1, 5)
FIRST = np.array([[0, 1, 2]], np.int32)


def at(depths_m: tuple[float, ...], pixels: tuple[tuple[int, int], ...] = CORNERS_PX) -> np.ndarray:
    """Return the points (n, 3) that are seen in these pixels at these depths."""
    rays = (np.array(pixels) - (CAMERA.cx, CAMERA.cy)) / CAMERA.fx
    return np.column_stack([rays, np.ones(len(rays))]) * np.array(depths_m)[:, None]


def rendered(*triangles: np.ndarray, light: np.ndarray = TOWARDS) -> Rendering:
    """Render triangles (3, 3); the first is red, others are green."""
    colours = np.repeat([RED, GREEN][: len(triangles)], 3, axis=0).astype(np.uint8)
    faces = np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    return render(np.concatenate(triangles), faces, colours, CAMERA, light)


def test_a_level_triangle_has_one_depth_in_the_pixels_that_it_covers() -> None:
    found = rendered(at((2.0, 2.0, 2.0)))
    expected = np.zeros((6, 8), bool)
    for row, width in zip(range(1, 6), (5, 4, 3, 2, 1), strict=True):
        expected[row, 1 : 1 + width] = True
    np.testing.assert_array_equal(found.silhouette, expected)
    assert found.depth_m[expected] == pytest.approx(2.0)
    assert np.isinf(found.depth_m[~expected]).all()
    assert (found.colour[~expected] == 0).all()
    # The number is cut, not rounded.
    assert np.abs(found.colour[expected] - np.int64(RED)).max() <= 1


def test_the_inverse_of_the_depth_is_linear_in_the_image() -> None:
    depth_m = rendered(at((1.0, 2.0, 4.0))).depth_m
    assert depth_m[1, 1] == pytest.approx(1.0)
    # Half way the inverse is (1 + 1/2) / 2, or (1 + 1/4) / 2, or (1/2 + 1/4) / 2.
    assert depth_m[1, 3] == pytest.approx(4 / 3)
    assert depth_m[3, 1] == pytest.approx(8 / 5)
    assert depth_m[3, 3] == pytest.approx(8 / 3)


@pytest.mark.parametrize("is_first", [True, False])
def test_the_nearer_triangle_wins_in_any_order(is_first: bool) -> None:
    far, near = at((3.0, 3.0, 3.0)), at((2.0, 2.0, 2.0), ((1, 1), (3, 1), (1, 3)))
    found = rendered(near, far) if is_first else rendered(far, near)
    of_near, of_far = (0, 1) if is_first else (1, 0)
    assert found.depth_m[1, 1] == pytest.approx(2.0) and found.colour[1, 1, of_near] > 90
    assert found.depth_m[1, 5] == pytest.approx(3.0) and found.colour[1, 5, of_far] > 90


def test_triangles_that_cross_divide_the_image() -> None:
    """The first one is nearer on the left; both are at the inverse depth 5/8 at column 3."""
    depth_m = rendered(at((1.0, 4.0, 1.0)), at((1.6, 1.6, 1.6))).depth_m
    assert depth_m[1, 2] == pytest.approx(16 / 13)
    assert depth_m[1, 3:6] == pytest.approx(1.6)


@pytest.mark.parametrize("depth_m", [-1.0, 0.05, 0.0])
def test_triangles_that_reach_behind_the_camera_are_left_out(depth_m: float) -> None:
    corners = at((2.0, 2.0, 2.0))
    corners[1, 2] = depth_m
    assert not rendered(corners).silhouette.any()


def test_triangles_end_at_the_edges_of_the_image() -> None:
    wide = rendered(at((2.0, 2.0, 2.0), ((-50, -50), (100, -50), (-50, 100))))
    assert wide.silhouette.all()
    beside = rendered(at((2.0, 2.0, 2.0), ((9, 0), (20, 0), (9, 5))))
    assert not beside.silhouette.any()


def test_light_from_the_side_is_darker_and_both_sides_are_lit() -> None:
    level = at((2.0, 2.0, 2.0))
    across = rendered(level, light=np.array([1.0, 0.0, 0.0])).colour[1, 1, 0]
    assert across == pytest.approx(0.55 * RED[0], abs=1)
    away = rendered(level, light=-TOWARDS).colour[1, 1, 0]
    assert away == rendered(level[[0, 2, 1]]).colour[1, 1, 0] == pytest.approx(RED[0], abs=1)


@settings(max_examples=60)
@given(st.lists(st.floats(0.0, 2.0 * np.pi), min_size=4, max_size=4, unique=True), st.booleans())
def test_two_triangles_of_a_quad_have_no_gap_between_them(angles: list[float], swap: bool) -> None:
    """Corners are on a circle, so that the quad is convex."""
    turns = np.sort(angles)
    camera = Camera(60, 60, 30.0, 30.0, 29.5, 29.5)
    px = 29.5 + 25.0 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    corners = np.column_stack([(px - 29.5) / 30.0, np.ones(4)])
    faces = np.array([(0, 1, 2), (0, 2, 3)] if swap else [(1, 2, 3), (1, 3, 0)], np.int32)
    seen = render(corners, faces, np.zeros((4, 3), np.uint8), camera, TOWARDS).silhouette
    row, column = np.indices(seen.shape)
    ahead = np.roll(px, -1, axis=0) - px
    sides = ahead[:, 0, None, None] * (row - px[:, 1, None, None]) - ahead[:, 1, None, None] * (
        column - px[:, 0, None, None]
    )
    # Pixels on the outline may be on either side by rounding.
    assert seen[(sides > 1e-6).all(axis=0)].all()
    assert not seen[(sides < -1e-6).any(axis=0)].any()
