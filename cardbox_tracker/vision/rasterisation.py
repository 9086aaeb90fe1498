"""Which pixels a planar patch covers: the definition, written for reading, not for speed.

A pixel is covered where its centre lies inside the projected patch. Corners are first moved to a
grid of 1/256 px, so that two programs that compute them with different rounding still agree on
every pixel. For row v and each edge that crosses it, from its upper end
(x0, y0) to its lower end (x1, y1), the half-open rule

    y0 <= v < y1,    x(v) = x0 + (v - y0) (x1 - x0) / (y1 - y0)

gives the crossing, and the columns ceil(min x) <= u < ceil(max x) are covered. Neighbouring patches
that share an edge therefore neither overlap nor leave a gap.

The compiled cost in :mod:`cardbox_tracker.estimation.compiled` must agree with this pixel by pixel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.camera import Camera, FloatArray

NEAR_PLANE_M = 0.1
"""What is nearer to the camera's plane than this is cut off, and what lies behind it, too."""

SUBPIXELS = 256.0


def clip_near(corners_m: FloatArray) -> FloatArray:
    """Cut a polygon (n, 3) of the optical frame at the near plane (Sutherland-Hodgman).

    Returns:
        Shape (m, 3) with m from 0 to n + 1, metres.
    """
    kept = []
    for start, end in zip(corners_m, np.roll(corners_m, -1, axis=0), strict=True):
        if start[2] >= NEAR_PLANE_M:
            kept.append(start)
        if (start[2] >= NEAR_PLANE_M) != (end[2] >= NEAR_PLANE_M):
            t = (NEAR_PLANE_M - start[2]) / (end[2] - start[2])
            kept.append(np.array([*(start[:2] + t * (end[:2] - start[:2])), NEAR_PLANE_M]))
    return np.array(kept).reshape(-1, 3)


def snap(pixels: FloatArray) -> FloatArray:
    """Move pixel coordinates to the nearest point of the 1/256 px grid."""
    return np.floor(np.asarray(pixels) * SUBPIXELS + 0.5) / SUBPIXELS


def fill_convex(mask: NDArray[np.uint8], polygon_px: FloatArray) -> None:
    """Set the covered pixels of ``mask`` (H, W) to 255.

    Args:
        mask: changed in place.
        polygon_px: convex, shape (n, 2), snapped pixel coordinates; parts outside are ignored.
    """
    height, width = mask.shape
    if len(polygon_px) < 3:
        return
    top = int(np.clip(np.ceil(polygon_px[:, 1].min()), 0, height))
    bottom = int(np.clip(np.ceil(polygon_px[:, 1].max()), 0, height))
    for v in range(top, bottom):
        crossings = []
        for ends in zip(polygon_px, np.roll(polygon_px, -1, axis=0), strict=True):
            # From the upper end whichever patch the edge belongs to: both round to one crossing.
            (x0, y0), (x1, y1) = sorted(ends, key=lambda corner: corner[1])
            if y0 <= v < y1:
                crossings.append(x0 + (v - y0) * ((x1 - x0) / (y1 - y0)))
        first, last = np.clip(np.ceil([min(crossings), max(crossings)]), 0, width).astype(int)
        mask[v, first:last] = 255


def render(patches_m: FloatArray, camera: Camera, height: int | None = None) -> NDArray[np.uint8]:
    """Draw patches of the reference frame as the camera sees them: h(x, y, d) of equation (2).

    Args:
        patches_m: shape (n, 4, 3), planar convex patches, metres in the reference frame.
        camera: the working camera.
        height: rows to draw, from the top; all of the camera's by default.

    Returns:
        Shape (height, camera.width), 0 or 255.
    """
    mask = np.zeros((camera.height if height is None else height, camera.width), np.uint8)
    for corners_m in camera.reference_to_optical(patches_m):
        fill_convex(mask, snap(camera.project(clip_near(corners_m))))
    return mask
