"""Compiled points of a body's outline: on edges of patches that no other patch covers."""

from __future__ import annotations

from math import hypot

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import index, inlined_kernel, kernel
from cardbox_tracker.terms.body_outline import BODY_PATCHES
from cardbox_tracker.terms.kernel_arguments import Floats

Ints = NDArray[np.int64]

# Points on each edge of a patch.
_ON_EDGE = 6
POINTS = BODY_PATCHES * 4 * _ON_EDGE
# Depth inside another patch at which a point is covered.
_COVERED_PX = 0.5


@kernel
def project_corners(corners_m: Floats, lens: Floats, corners_px: Floats) -> None:
    """Write the projected corners of all patches, (13, 4, 3): column, row, px; 1 / depth, 1 / m.

    ``corners_m`` (3, 52), metres in the optical frame, are those of ``Workspace``; ``lens`` is fx,
    fy, cx, cy.
    """
    for p in range(BODY_PATCHES):
        for c in range(4):
            e = c * BODY_PATCHES + p
            inverse = 1.0 / max(corners_m[2, e], 0.05)
            corners_px[p, c, 0] = lens[0] * corners_m[0, e] * inverse + lens[2]
            corners_px[p, c, 1] = lens[1] * corners_m[1, e] * inverse + lens[3]
            corners_px[p, c, 2] = inverse


@inlined_kernel
def point_on_edge(corners_px: Floats, p: int, c: int, share: float) -> tuple[float, float, float]:
    """Return column, row and inverse depth at a fraction of the edge from corner ``c``."""
    begin, end = corners_px[index(p), index(c)], corners_px[index(p), index((c + 1) & 3)]
    x, y, inverse = begin[0], begin[1], begin[2]
    return (
        x + share * (end[0] - x),
        y + share * (end[1] - y),
        inverse + share * (end[2] - inverse),
    )


@inlined_kernel
def _bound(corners_px: Floats, sides_px: Floats, insides: Floats, boxes: Floats) -> None:
    """Write edges and bounding boxes of the patches with corners (13, 4, 3).

    ``sides_px`` (13, 4) are lengths of edges; ``insides`` (13, 4, 3) a, b, c of each edge, inside
    of which, by at least ``_COVERED_PX``, a x + b y + c >= 0; ``boxes`` (13, 4) first and last
    column, first and last row.
    """
    for p in range(BODY_PATCHES):
        corners, box = corners_px[p], boxes[p]
        box[0], box[1] = corners[0, 0], corners[0, 0]
        box[2], box[3] = corners[0, 1], corners[0, 1]
        twice_area = 0.0
        for c in range(4):
            x, y = corners[c, 0], corners[c, 1]
            next_x, next_y = corners[(c + 1) % 4, 0], corners[(c + 1) % 4, 1]
            box[0], box[1] = min(box[0], x), max(box[1], x)
            box[2], box[3] = min(box[2], y), max(box[3], y)
            sides_px[p, c] = hypot(next_x - x, next_y - y)
            twice_area += x * next_y - next_x * y
        for c in range(4):
            d = (c + 1) % 4
            length = sides_px[p, c]
            scale = (1.0 if twice_area > 0.0 else -1.0) / max(length, 1e-9)
            a = -scale * (corners[d, 1] - corners[c, 1])
            b = scale * (corners[d, 0] - corners[c, 0])
            # An edge without length bounds nothing, and a patch without area covers nothing.
            bounds = length >= 1e-9 or abs(twice_area) < 1e-9
            margin = _COVERED_PX if bounds else -_COVERED_PX
            insides[p, c, 0], insides[p, c, 1] = a, b
            insides[p, c, 2] = -a * corners[c, 0] - b * corners[c, 1] - margin


@inlined_kernel
def _covered_share(
    sides: Floats, x: float, y: float, along_x: float, along_y: float
) -> tuple[float, float]:
    """Return the fractions of a line between which a convex patch covers it.

    The line leads from (x, y) to (x + along_x, y + along_y); ``sides`` are the patch's edges (4,
    3), see :func:`_bound`.
    """
    first, last = 0.0, 1.0
    for c in range(4):
        begin = sides[c, 0] * x + sides[c, 1] * y + sides[c, 2]
        change = sides[c, 0] * along_x + sides[c, 1] * along_y
        if begin < 0.0:
            if begin + change < 0.0:
                return 1.0, 0.0
            first = max(first, -begin / change)
        elif begin + change < 0.0:
            last = min(last, -begin / change)
    return first, last


@kernel
def find_outline(corners_px: Floats, within: Floats, edges: Ints, points: Floats) -> int:
    """Write the points that are on the outline, and return their number.

    ``corners_px`` is that of :func:`project_corners`; ``within`` (4,) are first and last column,
    first and end row of the part that counts. ``edges`` (312, 2) are patch and first corner of the
    edge of each point, ``points`` (312, 2) its fraction of the edge, and the length of the outline
    there, px.
    """
    left, right, top, bottom = within[0], within[1], within[2], within[3]
    sides_px, insides = np.empty((BODY_PATCHES, 4)), np.empty((BODY_PATCHES, 4, 3))
    boxes, near = np.empty((BODY_PATCHES, 4)), np.empty(BODY_PATCHES, np.int64)
    _bound(corners_px, sides_px, insides, boxes)
    covered = np.empty((BODY_PATCHES, 2))
    count = 0
    for p in range(BODY_PATCHES):
        n_near, box = 0, boxes[p]
        for other in range(BODY_PATCHES):
            there = boxes[other]
            beside = box[1] >= there[0] and there[1] >= box[0]
            if other != p and beside and box[3] >= there[2] and there[3] >= box[2]:
                near[n_near] = other
                n_near += 1
        for c in range(4):
            length = sides_px[p, c]
            if length == 0.0:
                continue
            x, y = corners_px[p, c, 0], corners_px[p, c, 1]
            along_x = corners_px[p, (c + 1) % 4, 0] - x
            along_y = corners_px[p, (c + 1) % 4, 1] - y
            n_covered = 0
            for i in range(n_near):
                first, last = _covered_share(insides[near[i]], x, y, along_x, along_y)
                if first <= last:
                    covered[n_covered, 0], covered[n_covered, 1] = first, last
                    n_covered += 1
            for k in range(_ON_EDGE):
                share = (k + 0.5) / _ON_EDGE
                u, v = x + share * along_x, y + share * along_y
                counts = left <= u <= right and top <= v < bottom
                for i in range(n_covered):
                    counts = counts and not covered[i, 0] <= share <= covered[i, 1]
                if counts:
                    edges[count, 0], edges[count, 1] = p, c
                    points[count, 0], points[count, 1] = share, length / _ON_EDGE
                    count += 1
    return count


@inlined_kernel
def distance_at(field: NDArray[np.float32], x: float, y: float) -> float:
    """Return the value of ``field`` (H, W), 2x2 or larger, at a point by bilinear interpolation."""
    height, width = field.shape
    # In this order nan becomes 0, which is an index.
    x = min(max(0.0, x), width - 1.001)
    y = min(max(0.0, y), height - 1.001)
    u, v = int(x), int(y)
    a, b = x - u, y - v
    above, below = field[index(v)], field[index(v + 1)]
    upper, lower = above[index(u)], below[index(u)]
    upper += a * (above[index(u + 1)] - upper)
    lower += a * (below[index(u + 1)] - lower)
    distance: float = upper + b * (lower - upper)
    return distance
