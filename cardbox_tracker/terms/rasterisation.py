"""Compiled rasterisation: the two columns where each row crosses the outline of each patch.

The results are equal to those of :mod:`cardbox_tracker.camera.rasterisation`. The loops over
patches or rows have no branches and use 32-bit integers, so that they can be vectorized. Patches
that the near plane cuts, or that rounding makes concave, use slower code.

Corners and edges of K patches are flat arrays: entry c K + p is corner c of patch p, in order
around it, or the edge from that corner to the next.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.rasterisation import CROSSING_BITS, FARTHEST_PX, NEAR_PLANE_M, SUBPIXELS
from cardbox_tracker.common.compiling import (
    Index,
    borrowing_kernel,
    index,
    inlined_allocation,
    inlined_kernel,
)
from cardbox_tracker.terms.kernel_arguments import Counts, Floats, Intrinsics, Whole

_ONE = float(2**CROSSING_BITS)
_BITS = np.int32(CROSSING_BITS)
_ROUND_UP = 2**CROSSING_BITS - 1
# Largest step of an edge; a flatter edge meets at most one row, and its step is not used.
_STEEPEST = 32000.0

# Rows of the array of edges.
_FIRST_ROW, _END_ROW, _CROSSING, _STEP = 0, 1, 2, 3


class Workspace(NamedTuple):
    """Scratch arrays of one call for K patches.

    Inlined functions take the whole workspace. Other functions take only the arrays that they need,
    because many arguments make a call slow.
    """

    shape: Floats
    """(3, 4 K): corners in the frame of the part, metres."""
    corners: Floats
    """(3, 4 K): the same in the optical frame."""
    pixels: Floats
    """(2, 5 K): the corners projected and snapped; the fifth corner repeats the first."""
    edges: Whole
    """(4, 4 K): first and end row, column at the first row and step per row, 2^-16 px."""
    sides: Whole
    """(K, 2, rows): the two columns where a row crosses the outline of a patch, in any order."""
    extent: Counts
    """(K, 2): first and end row of a patch."""
    outline: Floats
    """(2, 6): corners of a patch that the near plane cuts, pixels. Rounding can give a sixth corner
    to a patch that lies in the near plane."""
    torso: Floats
    upper_arm: Floats
    forearm: Floats
    """(3, 3): rotations from the parts' frames to the optical frame."""
    hip: Floats
    joint: Floats
    """(3,): middle of the hips, and shoulder or elbow, in the optical frame, metres."""


@inlined_allocation
def new_workspace(patches: int, rows: int) -> Workspace:
    """Return the workspace for a number of patches and rows; ``shape`` is zero."""
    return Workspace(
        shape=np.zeros((3, 4 * patches)),
        corners=np.zeros((3, 4 * patches)),
        pixels=np.empty((2, 5 * patches)),
        edges=np.empty((4, 4 * patches), np.int32),
        sides=np.empty((patches, 2, rows), np.int32),
        extent=np.empty((patches, 2), np.int64),
        outline=np.empty((2, 6)),
        torso=np.empty((3, 3)),
        upper_arm=np.empty((3, 3)),
        forearm=np.empty((3, 3)),
        hip=np.empty(3),
        joint=np.empty(3),
    )


@inlined_kernel
def _snap(pixel: float) -> float:
    """Return the nearest point of the 1/256 px grid, within 16000 px."""
    # In this order nan becomes the limit, so that rows of a patch never stay unwritten.
    near = min(max(-FARTHEST_PX, pixel), FARTHEST_PX)
    snapped: float = np.floor(near * SUBPIXELS + 0.5) / SUBPIXELS
    return snapped


@inlined_kernel
def _row(y: float, rows: float) -> float:
    """Return the first row at or below ``y``, within the image."""
    row: float = np.ceil(min(max(y, 0.0), rows))
    return row


@inlined_kernel
def draw(work: Workspace, camera: Intrinsics, rows: int, width: int) -> bool:
    """Write sides and extent of all patches from their corners.

    Returns:
        Whether a corner is behind the near plane, so that its ``pixels`` have no meaning.

    An edge from its upper end (x0, y0) to its lower end (x1, y1) has the slope
    s = (x1 - x0) / (y1 - y0), first meets row v0 = ceil(y0), crosses it at x0 + (v0 - y0) s and
    moves by s from row to row.
    """
    corners, pixels, edges, extent = work.corners, work.pixels, work.edges, work.extent
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    patches = extent.shape[0]
    behind = 0
    for e in range(4 * patches):
        z = corners[2, index(e)]
        behind += z < NEAR_PLANE_M
        nearness = 1.0 / z
        pixels[0, index(e)] = _snap(fx * corners[0, index(e)] * nearness + cx)
        pixels[1, index(e)] = _snap(fy * corners[1, index(e)] * nearness + cy)
    if behind > 0:
        for p in range(patches):
            _draw_cut(work, p, camera, rows, width)
        return True
    limit = float(rows)
    for p in range(patches):
        pixels[0, index(4 * patches + p)] = pixels[0, index(p)]
        pixels[1, index(4 * patches + p)] = pixels[1, index(p)]
    for e in range(4 * patches):
        x0, x1 = pixels[0, index(e)], pixels[0, index(e + patches)]
        y0, y1 = pixels[1, index(e)], pixels[1, index(e + patches)]
        slope = (x1 - x0) / (1.0 if y0 == y1 else y1 - y0)
        upper_x = x0 if y0 < y1 else x1
        upper_y = min(y0, y1)
        row = _row(upper_y, limit)
        # A level edge meets no row; its crossing only has to be finite.
        crossing = upper_x + (0.0 if y0 == y1 else (row - upper_y) * slope)
        step = min(max(slope, -_STEEPEST), _STEEPEST)
        edges[_FIRST_ROW, index(e)] = np.int32(row)
        edges[_END_ROW, index(e)] = np.int32(_row(max(y0, y1), limit))
        edges[_CROSSING, index(e)] = np.int32(np.floor(crossing * _ONE + 0.5))
        edges[_STEP, index(e)] = np.int32(np.floor(step * _ONE + 0.5))
    for p in range(patches):
        # Downward edges write one side of their rows, upward edges the other. Each row gets both
        # sides once, unless rounding makes a thin patch concave.
        y0, y1 = pixels[1, index(p)], pixels[1, index(p + patches)]
        y2, y3 = pixels[1, index(p + 2 * patches)], pixels[1, index(p + 3 * patches)]
        a, b, c, d = y1 > y0, y2 > y1, y3 > y2, y0 > y3
        if (a != b) + (b != c) + (c != d) + (d != a) > 2:
            _draw_cut(work, p, camera, rows, width)
            continue
        extent[p, 0] = np.int64(_row(min(min(y0, y1), min(y2, y3)), limit))
        extent[p, 1] = np.int64(_row(max(max(y0, y1), max(y2, y3)), limit))
        _cross(edges, p, p, index(a), work.sides, width)
        _cross(edges, p + patches, p, index(b), work.sides, width)
        _cross(edges, p + 2 * patches, p, index(c), work.sides, width)
        _cross(edges, p + 3 * patches, p, index(d), work.sides, width)
    return False


@inlined_kernel
def _cross(edges: Whole, e: int, p: int, side: Index, sides: Whole, width: int) -> None:
    """Write the columns where edge ``e`` crosses its rows, as one side of patch ``p``."""
    first = np.int64(edges[_FIRST_ROW, index(e)])
    x, step, limit = edges[_CROSSING, index(e)], edges[_STEP, index(e)], np.int32(width)
    base, k = index(first), index(p)
    for i in range(np.int64(edges[_END_ROW, index(e)]) - first):
        u = np.int32(np.int32(x + np.int32(i) * step + np.int32(_ROUND_UP)) >> _BITS)
        sides[k, side, base + index(i)] = min(max(u, np.int32(0)), limit)


@borrowing_kernel
def _draw_cut(work: Workspace, p: int, camera: Intrinsics, rows: int, width: int) -> None:
    """Write sides and extent of patch ``p`` after clipping at the near plane.

    The algorithm is that of :func:`cardbox_tracker.camera.rasterisation.clip_near` and
    ``fill_convex``.
    """
    corners, sides, extent, outline = work.corners, work.sides, work.extent, work.outline
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    patches = extent.shape[0]
    n = 0
    for corner in range(4):
        c, d = corner * patches + p, (corner + 1) % 4 * patches + p
        z0, z1 = corners[2, c], corners[2, d]
        if z0 >= NEAR_PLANE_M:
            nearness = 1.0 / z0
            outline[0, n] = _snap(fx * corners[0, c] * nearness + cx)
            outline[1, n] = _snap(fy * corners[1, c] * nearness + cy)
            n += 1
        if (z0 >= NEAR_PLANE_M) != (z1 >= NEAR_PLANE_M):
            t = (NEAR_PLANE_M - z0) / (z1 - z0)
            x = corners[0, c] + t * (corners[0, d] - corners[0, c])
            y = corners[1, c] + t * (corners[1, d] - corners[1, c])
            outline[0, n] = _snap(fx * x / NEAR_PLANE_M + cx)
            outline[1, n] = _snap(fy * y / NEAR_PLANE_M + cy)
            n += 1
    extent[p, 0] = extent[p, 1] = 0
    if n < 3:
        return
    ys = outline[1, :n]
    highest, lowest = ys[0], ys[0]
    for i in range(1, n):
        highest, lowest = min(highest, ys[i]), max(lowest, ys[i])
    top, bottom = int(_row(highest, rows)), int(_row(lowest, rows))
    extent[p, 0] = top
    extent[p, 1] = bottom
    for v in range(top, bottom):
        sides[p, 0, v] = width
        sides[p, 1, v] = 0
    for i in range(n):
        j = (i + 1) % n
        if ys[i] > ys[j]:
            i, j = j, i
        x0, y0, x1, y1 = outline[0, i], ys[i], outline[0, j], ys[j]
        low, high = int(_row(y0, rows)), int(_row(y1, rows))
        if low < high:
            slope = (x1 - x0) / (y1 - y0)
            x = int(np.floor((x0 + (low - y0) * slope) * _ONE + 0.5)) + _ROUND_UP
            step = int(np.floor(slope * _ONE + 0.5))
            for v in range(low, high):
                u = min(max((x + (v - low) * step) >> CROSSING_BITS, 0), width)
                sides[p, 0, v] = min(sides[p, 0, v], u)
                sides[p, 1, v] = max(sides[p, 1, v], u)
