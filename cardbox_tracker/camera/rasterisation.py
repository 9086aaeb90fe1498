"""Reference rasterisation of planar patches, written for clarity instead of speed.

A pixel is covered where its centre lies inside the projected patch. To give the same result on
every computer, coordinates are integers: corners are rounded to a grid of 1/256 px, and an edge is
a line that starts at the first row v0 of the image below its upper end (x0, y0), and moves by the
same multiple of 1/65536 px from row to row down to its lower end (x1, y1). With
s = (x1 - x0) / (y1 - y0), row v of y0 <= v < y1 is crossed at

    X(v) = round(65536 (x0 + (v0 - y0) s)) + (v - v0) round(65536 s)

and the columns ceil(min X / 65536) <= u < ceil(max X / 65536) are covered. Neighbouring patches
that share an edge therefore neither overlap nor leave a gap.

The compiled cost (``terms/compiled.py``) must agree with this pixel by pixel; 32 bits
suffice, since corners are clamped to 16000 px.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera, FloatArray

NEAR_PLANE_M = 0.1
"""Depth of the near plane, metres; nearer points are clipped, see ``in_front``."""

SUBPIXELS = 256.0
"""Grid points per pixel to which corners are rounded."""

CROSSING_BITS = 16
"""Bits of the fraction in the crossings of edges and rows: multiples of 2^-16 px."""

FARTHEST_PX = 16000.0
"""Largest coordinate of a corner; others are clamped to it."""


def in_front(points_m: FloatArray) -> NDArray[np.bool_]:
    """Return which points (..., 3), metres, of the optical frame lie on or behind the near plane.

    Polygons are cut there by :func:`clip_near`; lines of a skeleton are dropped unless all their
    points are kept.
    """
    visible: NDArray[np.bool_] = np.asarray(points_m)[..., 2] >= NEAR_PLANE_M
    return visible


def clip_near(corners_m: FloatArray) -> FloatArray:
    """Clip a convex polygon (n, 3), metres, optical frame, at the near plane: n + 1 or fewer."""
    kept = []
    for start, end in zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True):
        if in_front(start):
            kept.append(start)
        if in_front(start) != in_front(end):
            t = (NEAR_PLANE_M - start[2]) / (end[2] - start[2])
            kept.append(np.array([*(start[:2] + t * (end[:2] - start[:2])), NEAR_PLANE_M]))
    return np.array(kept).reshape(-1, 3)


def snap(pixels: FloatArray) -> FloatArray:
    """Round pixel coordinates to the 1/256 px grid and clamp them to 16000 px."""
    near = np.clip(np.asarray(pixels, dtype=np.float64), -FARTHEST_PX, FARTHEST_PX)
    snapped: FloatArray = np.floor(near * SUBPIXELS + 0.5) / SUBPIXELS
    return snapped


def fill_convex(mask: NDArray[np.uint8], polygon_px: FloatArray) -> None:
    """Set the pixels of ``mask`` (H, W) that a convex polygon (n, 2), snapped px, covers to 255."""
    height = mask.shape[0]
    if len(polygon_px) < 3:
        return
    crossings: dict[int, list[int]] = {}
    for ends in zip(polygon_px, np.roll(polygon_px, -1, axis=0), strict=True):
        # Every edge starts at its upper end, so that both patches that share it round alike.
        (x0, y0), (x1, y1) = sorted(ends, key=lambda corner: float(corner[1]))
        first, end = (int(v) for v in np.clip(np.ceil([y0, y1]), 0, height))
        if first < end:
            slope = (x1 - x0) / (y1 - y0)
            start, step = _fixed(x0 + (first - y0) * slope), _fixed(slope)
            for v in range(first, end):
                crossings.setdefault(v, []).append(start + (v - first) * step)
    for v, found in crossings.items():
        left, right = (-(-x >> CROSSING_BITS) for x in (min(found), max(found)))
        mask[v, max(left, 0) : max(right, 0)] = 255


def _fixed(pixels: float) -> int:
    """Return a coordinate, px, as an integer multiple of 2^-16 px."""
    return int(np.floor(pixels * 2**CROSSING_BITS + 0.5))


def render(patches_m: FloatArray, camera: Camera, height: int | None = None) -> NDArray[np.uint8]:
    """Render convex patches (n, 4, 3), metres, as seen by the camera: h(x, y, d) of equation (2).

    The patches are in the reference frame. The image (height, camera.width) is 0 or 255; its
    ``height`` is that of the camera unless it is cut off below.
    """
    mask = np.zeros((camera.height if height is None else height, camera.width), np.uint8)
    for corners_m in camera.reference_to_optical(patches_m):
        fill_convex(mask, snap(camera.project(clip_near(corners_m))))
    return mask
