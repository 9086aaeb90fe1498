"""Compiled: the points of a body's outline in an image, and where they are when it moves.

The outline are points on the edges of the patches that no other patch covers.
"""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats
from cardbox_tracker.estimation.cost.outline_distances import FAR_PX
from cardbox_tracker.estimation.cost.whole_body_kernels import BODY_PATCHES

Ints = NDArray[np.int64]

_compile = njit(cache=True, nogil=True, error_model="numpy")

# Points on each edge of a patch.
_ON_EDGE = 6
POINTS = BODY_PATCHES * 4 * _ON_EDGE
# A point counts as covered so far inside another patch, and is no outline so near to the border.
_COVERED_PX, _BORDER_PX = 0.5, 3.0


@_compile
def project_corners(corners_m: Floats, lens: Floats, corners_px: Floats) -> None:
    """Write corners (13, 4, 2), px; ``lens`` is fx, fy, cx, cy."""
    for p in range(BODY_PATCHES):
        for c in range(4):
            x, y, z = corners_m[p, c, 0], corners_m[p, c, 1], max(corners_m[p, c, 2], 0.05)
            corners_px[p, c, 0] = lens[0] * x / z + lens[2]
            corners_px[p, c, 1] = lens[1] * y / z + lens[3]


@_compile
def point_on_edge(corners_px: Floats, p: int, c: int, share: float) -> tuple[float, float]:
    """Return the point at a share of the edge that begins at corner ``c`` of patch ``p``, px."""
    d = (c + 1) % 4
    x, y = corners_px[p, c, 0], corners_px[p, c, 1]
    return x + share * (corners_px[p, d, 0] - x), y + share * (corners_px[p, d, 1] - y)


@_compile
def _turns(corners_px: Floats, turns: Floats, sides_px: Floats) -> None:
    """Write how patches lie.

    Args:
        corners_px: (13, 4, 2).
        turns: whether the corners of each run one way round, 1, or the other, -1; (13,).
        sides_px: how long each edge is, (13, 4).
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


@_compile
def _is_inside(
    corners_px: Floats, sides_px: Floats, p: int, turn: float, x: float, y: float
) -> bool:
    """Whether a point is well inside the convex patch ``p``, whose corners run by ``turn``."""
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


@_compile
def find_outline(
    corners_px: Floats, size: tuple[int, int], end_row: float, edges: Ints, points: Floats
) -> int:
    """Write the points that are on the outline.

    Args:
        corners_px: (13, 4, 2).
        size: width and height of the image.
        end_row: rows from it on do not count.
        edges: written: patch and corner at which the edge of a point begins, (312, 2).
        points: written: the share of the edge there, and how much outline the point stands for, px,
            (312, 2).

    Returns:
        How many they are.
    """
    width, height = size
    end = min(end_row, height - _BORDER_PX)
    turns = np.empty(BODY_PATCHES)
    sides_px = np.empty((BODY_PATCHES, 4))
    _turns(corners_px, turns, sides_px)
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
                        if other != p and _is_inside(
                            corners_px, sides_px, other, turns[other], x, y
                        ):
                            counts = False
                            break
                if counts:
                    edges[count, 0], edges[count, 1] = p, c
                    points[count, 0], points[count, 1] = share, length / _ON_EDGE
                    count += 1
    return count


@_compile
def distance_at(field: NDArray[np.float32], x: float, y: float) -> float:
    """Return the value of ``field`` (H, W) at a point, linear between pixels."""
    height, width = field.shape
    x = min(max(x, 0.0), width - 1.001)
    y = min(max(y, 0.0), height - 1.001)
    u, v = int(x), int(y)
    a, b = x - u, y - v
    upper = field[v, u] * (1.0 - a) + field[v, u + 1] * a
    lower = field[v + 1, u] * (1.0 - a) + field[v + 1, u + 1] * a
    distance: float = min(max(upper * (1.0 - b) + lower * b, -FAR_PX), FAR_PX)
    return distance


@_compile
def unmoved_patches(one_px: Floats, other_px: Floats, same: NDArray[np.bool_]) -> None:
    """Write which patches are where they were, (13,)."""
    for p in range(BODY_PATCHES):
        same[p] = True
        for c in range(4):
            if one_px[p, c, 0] != other_px[p, c, 0] or one_px[p, c, 1] != other_px[p, c, 1]:
                same[p] = False
