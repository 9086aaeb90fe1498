"""Points of the outline of patches in an image."""

from __future__ import annotations

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.terms.body_outline import BODY_PATCHES
from cardbox_tracker.terms.outline_points import POINTS, find_outline

WITHIN = np.array([20.0, 180.0, 10.0, 140.0])
SHARES = (np.arange(6) + 0.5) / 6


def outline(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    edges, points = np.empty((POINTS, 2), np.int64), np.empty((POINTS, 2))
    corners_px = np.dstack([corners, np.ones(corners.shape[:2])])
    count = find_outline(corners_px, WITHIN, edges, points)
    return edges[:count], points[:count]


def rectangles(seed: int) -> np.ndarray:
    """Rotated rectangles (13, 4, 2) of either orientation, px."""
    rng = np.random.default_rng(seed)
    unit = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    found = []
    for _ in range(BODY_PATCHES):
        turn = rng.uniform(0.0, np.pi)
        axes = np.array([(np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))])
        corners = rng.uniform((0, 0), (200, 150)) + unit * rng.uniform(1, 40, 2) @ axes
        found.append(corners[::-1] if rng.random() < 0.5 else corners)
    return np.array(found)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_points_half_a_pixel_inside_another_patch_are_left_out(seed: int) -> None:
    corners = rectangles(seed)
    edges, points = outline(corners)
    samples = np.rint(6 * points[:, 0] - 0.5).astype(int)
    found = set(map(tuple, np.column_stack([edges, samples]).tolist()))
    assert len(found) == len(points)
    for p in range(BODY_PATCHES):
        for c in range(4):
            begin, end = corners[p, c], corners[p, (c + 1) % 4]
            for k, share in enumerate(SHARES):
                x, y = (begin + share * (end - begin)).tolist()
                # Positive inside.
                depth = max(
                    cv2.pointPolygonTest(np.float32(corners[q]), (x, y), True)
                    for q in range(BODY_PATCHES)
                    if q != p
                )
                seen = 20 <= x <= 180 and 10 <= y < 140
                if not seen or abs(depth - 0.5) > 1e-3:
                    assert ((p, c, k) in found) == (seen and depth < 0.5)


def test_lengths_are_those_of_the_edges() -> None:
    corners = np.full((BODY_PATCHES, 4, 2), np.nan)
    corners[3] = [(50, 50), (80, 50), (80, 110), (50, 110)]
    edges, points = outline(corners)
    assert set(edges[:, 0]) == {3}
    np.testing.assert_allclose(points[edges[:, 1] == 0, 0], SHARES)
    np.testing.assert_allclose(points[edges[:, 1] == 0, 1], 30.0 / 6)
    np.testing.assert_allclose(points[:, 1].sum(), 2 * (30.0 + 60.0))


def test_a_patch_without_area_covers_nothing() -> None:
    corners = np.full((BODY_PATCHES, 4, 2), np.nan)
    corners[0] = [(50, 50), (80, 50), (80, 110), (50, 110)]
    corners[1] = [(65, 50)] * 4
    corners[2] = [(40, 80), (90, 80), (90, 80), (40, 80)]
    edges, _ = outline(corners)
    assert (edges[:, 0] == 0).sum() == 24
