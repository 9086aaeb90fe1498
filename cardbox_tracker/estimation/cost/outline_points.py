"""Compiled points of a body's outline in an image.

The outline consists of points on the edges of the patches that no other patch covers.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.posture import (
    ARM_ANGLES,
    FIRST_ANGLES,
    PITCH,
    ROLL,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    YAW,
)
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.body_outline import (
    ARM_PATCHES,
    BODY_PATCHES,
    TRUNK_PATCHES,
)
from cardbox_tracker.estimation.cost.kernel_arguments import Floats
from cardbox_tracker.estimation.cost.outline_distances import FAR_PX

Ints = NDArray[np.int64]


# Points on each edge of a patch.
_ON_EDGE = 6
POINTS = BODY_PATCHES * 4 * _ON_EDGE
# Depth inside another patch at which a point is covered; margin of the image without points.
_COVERED_PX, _BORDER_PX = 0.5, 3.0


@kernel
def project_corners(
    corners_m: Floats, lens: Floats, first: int, end: int, corners_px: Floats
) -> None:
    """Write corners (13, 4, 2), px, of the patches ``first`` to ``end``.

    Args:
        corners_m: corners of all patches, (3, 52), metres in the optical frame, see ``Workspace``.
        lens: fx, fy, cx, cy.
        first: first patch.
        end: index after the last patch.
        corners_px: written.
    """
    for p in range(first, end):
        for c in range(4):
            e = c * BODY_PATCHES + p
            x, y, z = corners_m[0, e], corners_m[1, e], max(corners_m[2, e], 0.05)
            corners_px[p, c, 0] = lens[0] * x / z + lens[2]
            corners_px[p, c, 1] = lens[1] * y / z + lens[3]


@kernel
def point_on_edge(corners_px: Floats, p: int, c: int, share: float) -> tuple[float, float]:
    """Return the point at a fraction of the edge from corner ``c`` of patch ``p``, px."""
    d = (c + 1) % 4
    x, y = corners_px[p, c, 0], corners_px[p, c, 1]
    return x + share * (corners_px[p, d, 0] - x), y + share * (corners_px[p, d, 1] - y)


@kernel
def _turns(corners_px: Floats, turns: Floats, sides_px: Floats) -> None:
    """Write orientation and side lengths of the patches.

    Args:
        corners_px: (13, 4, 2).
        turns: orientation of each patch, 1 or -1, (13,).
        sides_px: length of each edge, (13, 4).
    """
    for p in range(BODY_PATCHES):
        twice_area = 0.0
        for c in range(4):
            d = (c + 1) % 4
            sides_px[p, c] = hypot(
                corners_px[p, d, 0] - corners_px[p, c, 0], corners_px[p, d, 1] - corners_px[p, c, 1]
            )
            twice_area += (
                corners_px[p, c, 0] * corners_px[p, d, 1]
                - corners_px[p, d, 0] * corners_px[p, c, 1]
            )
        turns[p] = 1.0 if twice_area > 0.0 else -1.0


@kernel
def _is_inside(
    corners_px: Floats, sides_px: Floats, p: int, turn: float, x: float, y: float
) -> bool:
    """Return whether a point is well inside the convex patch ``p`` with orientation ``turn``."""
    for c in range(4):
        d = (c + 1) % 4
        along_x = corners_px[p, d, 0] - corners_px[p, c, 0]
        along_y = corners_px[p, d, 1] - corners_px[p, c, 1]
        length = sides_px[p, c]
        if length < 1e-9:
            continue
        across = along_x * (y - corners_px[p, c, 1]) - along_y * (x - corners_px[p, c, 0])
        if turn * across < _COVERED_PX * length:
            return False
    return True


@kernel
def find_outline(
    corners_px: Floats, size: tuple[int, int], end_row: float, edges: Ints, points: Floats
) -> int:
    """Write the points that are on the outline.

    Args:
        corners_px: (13, 4, 2).
        size: width and height of the image.
        end_row: first row that does not count.
        edges: written: patch and first corner of the edge of each point, (312, 2).
        points: written: fraction of the edge, and length of the outline at the point, px, (312, 2).

    Returns:
        Number of points.
    """
    width, height = size
    end = min(end_row, height - _BORDER_PX)
    turns = np.empty(BODY_PATCHES)
    sides_px, boxes = np.empty((BODY_PATCHES, 4)), np.empty((BODY_PATCHES, 4))
    _turns(corners_px, turns, sides_px)
    for p in range(BODY_PATCHES):
        boxes[p, 0], boxes[p, 1] = corners_px[p, :, 0].min(), corners_px[p, :, 0].max()
        boxes[p, 2], boxes[p, 3] = corners_px[p, :, 1].min(), corners_px[p, :, 1].max()
    count = 0
    for p in range(BODY_PATCHES):
        for c in range(4):
            length = sides_px[p, c]
            if length == 0.0:
                continue
            for k in range(_ON_EDGE):
                share = (k + 0.5) / _ON_EDGE
                x, y = point_on_edge(corners_px, p, c, share)
                counts = _BORDER_PX <= x <= width - 1 - _BORDER_PX and _BORDER_PX <= y < end
                if counts:
                    for other in range(BODY_PATCHES):
                        box = boxes[other]
                        if other == p or not (box[0] <= x <= box[1] and box[2] <= y <= box[3]):
                            continue
                        if _is_inside(corners_px, sides_px, other, turns[other], x, y):
                            counts = False
                            break
                if counts:
                    edges[count, 0], edges[count, 1] = p, c
                    points[count, 0], points[count, 1] = share, length / _ON_EDGE
                    count += 1
    return count


@kernel
def distance_at(field: NDArray[np.float32], x: float, y: float) -> float:
    """Return the value of ``field`` (H, W), 2x2 or larger, at a point by bilinear interpolation."""
    height, width = field.shape
    # In this order nan becomes 0, which is an index.
    x = min(max(0.0, x), width - 1.001)
    y = min(max(0.0, y), height - 1.001)
    u, v = int(x), int(y)
    a, b = x - u, y - v
    upper = field[v, u] * (1.0 - a) + field[v, u + 1] * a
    lower = field[v + 1, u] * (1.0 - a) + field[v + 1, u + 1] * a
    distance: float = min(max(upper * (1.0 - b) + lower * b, -FAR_PX), FAR_PX)
    return distance


@kernel
def first_points(edges: Ints, count: int, first: Ints) -> None:
    """Write the index of each patch's first point, and the end of the last patch, (14,).

    Args:
        edges: patches, in order, and corners of the points, (n, 2).
        count: number of points.
        first: written.
    """
    p = 0
    for i in range(count):
        while p <= edges[i, 0]:
            first[p] = i
            p += 1
    for later in range(p, BODY_PATCHES + 1):
        first[later] = count


@kernel
def moved_patches(one: Floats, other: Floats) -> tuple[int, int]:
    """Return first and end index of the patches that differ between two states (14,)."""
    for j in (TORSO_Y, ROLL, PITCH, YAW, TORSO_X, TORSO_Z):
        if one[j] != other[j]:
            return 0, BODY_PATCHES
    first, end = BODY_PATCHES, 0
    for arm in range(2):
        for j in range(FIRST_ANGLES[arm], FIRST_ANGLES[arm] + ARM_ANGLES):
            if one[j] != other[j]:
                first = min(first, TRUNK_PATCHES + ARM_PATCHES * arm)
                end = TRUNK_PATCHES + ARM_PATCHES * (arm + 1)
    return min(first, end), end
