"""Compiled signed distances of pixels from the outline of a mask, up to ``FAR``.

The distances are Euclidean, between pixel centres. They are computed in two passes after
Felzenszwalb and Huttenlocher ("Distance Transforms of Sampled Functions", 2012): along the columns,
then along the rows as the least of nearby squared distances. The limit ``FAR`` keeps all loops
short and free of branches, and squared distances within 8 bits, of which many fit into a vector.
OpenCV's ``distanceTransform`` computes one side per call and is slower.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import index, kernel

FAR = 10
"""Limit of the distances, px."""
# Columns that a loop processes at once; a constant number leaves no rest for slower code.
_LANES = 64


def padded_width(width: int) -> int:
    """Return the number of columns of the distances of a mask with ``width`` columns."""
    return -(-(width + 2 * FAR) // _LANES) * _LANES


@kernel
def signed_distances_of(mask: NDArray[np.uint8], distances: NDArray[np.float32]) -> None:
    """Write the distance of each pixel from the nearest pixel of the other side, px.

    The mask (H, W) is 0 outside and 1 inside. The distances (H, :func:`padded_width` (W)), negative
    inside and limited to ``FAR``, have ``FAR`` columns more to the left of the mask, and ``FAR``
    or more to its right, where the mask continues as in its outermost columns.
    """
    height, width = mask.shape
    sides = np.empty(distances.shape, np.uint8)
    for v in range(height):
        # Assignments to slices take longer than loops.
        row, padded = mask[v], sides[v]
        for u in range(FAR):
            padded[index(u)] = row[0]
        for u in range(width):
            padded[index(u + FAR)] = row[index(u)]
        for u in range(FAR + width, padded.shape[0]):
            padded[index(u)] = row[index(width - 1)]
    columns = np.empty(distances.shape, np.uint8)
    _along_columns(sides, columns)
    _along_rows(sides, columns, distances)


@kernel
def _along_columns(mask: NDArray[np.uint8], distances: NDArray[np.uint8]) -> None:
    """Write the vertical distance to the nearest pixel of the other side, px."""
    height, width = mask.shape
    one, far = np.uint8(1), np.uint8(FAR)
    # The distances of the previous row, in an array of its own that the compiler can tell apart.
    last = np.empty(_LANES, np.uint8)
    for first in range(0, width, _LANES):
        end = first + _LANES
        last[:] = far
        distances[0, first:end] = far
        for v in range(1, height):
            here, inside = distances[v, first:end], mask[v, first:end]
            above = mask[v - 1, first:end]
            for u in range(_LANES):
                farther = np.uint8(last[index(u)] + one)
                farther = farther if farther < far else far
                farther = farther if inside[index(u)] == above[index(u)] else one
                last[index(u)], here[index(u)] = farther, farther
        for v in range(height - 2, -1, -1):
            here, inside = distances[v, first:end], mask[v, first:end]
            below = mask[v + 1, first:end]
            for u in range(_LANES):
                farther = np.uint8(last[index(u)] + one)
                farther = farther if inside[index(u)] == below[index(u)] else one
                now = here[index(u)]
                farther = farther if farther < now else now
                last[index(u)], here[index(u)] = farther, farther


@kernel
def _along_rows(
    mask: NDArray[np.uint8], columns: NDArray[np.uint8], distances: NDArray[np.float32]
) -> None:
    """Write the distances from those along the columns, px; all arrays have the same shape."""
    height, width = mask.shape
    none, far = np.uint8(0), np.uint8(FAR * FAR)
    # Squared distances of the pixels inside and outside, 0 on the other side.
    inner, outer = np.full(width + 2 * FAR, far), np.full(width + 2 * FAR, far)
    least_inner, least_outer = np.empty(width, np.uint8), np.empty(width, np.uint8)
    for v in range(height):
        column, inside, row = columns[v], mask[v], distances[v]
        for first in range(0, width, _LANES):
            for u in range(first, first + _LANES):
                square = np.uint8(column[index(u)] * column[index(u)])
                is_inside = inside[index(u)] != 0
                inner[index(u + FAR)] = square if is_inside else none
                outer[index(u + FAR)] = none if is_inside else square
        _least_along_row(inner, least_inner)
        _least_along_row(outer, least_outer)
        for first in range(0, width, _LANES):
            for u in range(first, first + _LANES):
                signed = np.int32(least_outer[index(u)]) - np.int32(least_inner[index(u)])
                square_px = np.float32(signed)
                row[index(u)] = np.copysign(np.sqrt(abs(square_px)), square_px)


@kernel
def _least_along_row(squares: NDArray[np.uint8], least: NDArray[np.uint8]) -> None:
    """Write the least of k^2 + ``squares`` (W + 2 ``FAR``,) at k pixels aside, (W,)."""
    for first in range(0, len(least), _LANES):
        for u in range(first, first + _LANES):
            now = squares[index(u + FAR)]
            # The compiler unrolls this loop and vectorizes the outer one.
            for k in range(1, FAR):
                one_way, other_way = squares[index(u + FAR - k)], squares[index(u + FAR + k)]
                nearer = one_way if one_way < other_way else other_way
                nearer = np.uint8(nearer + np.uint8(k * k))
                now = nearer if nearer < now else now
            least[index(u)] = now
