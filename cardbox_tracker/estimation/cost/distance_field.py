"""Compiled signed distances of pixels from the outline of a mask, up to ``FAR_PX``.

The distances are Euclidean, between pixel centres. They are computed in two passes after
Felzenszwalb and Huttenlocher ("Distance Transforms of Sampled Functions", 2012): along the columns,
then along the rows as the least of nearby squared distances. The limit ``FAR_PX`` keeps all loops
short and free of branches. OpenCV's ``distanceTransform`` computes one side per call and is slower.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.outline_distances import FAR_PX

# With an unsigned index, numba compiles no code for negative indices.
_index = np.uint64
_FAR = int(FAR_PX)
# Distances by their squares from -_FAR^2, outside, to _FAR^2, inside; roots are slower.
_SQUARES = np.arange(-_FAR * _FAR, _FAR * _FAR + 1)
_SIGNED = (-np.sign(_SQUARES) * np.sqrt(np.abs(_SQUARES))).astype(np.float32)


@kernel
def signed_distances_of(mask: NDArray[np.uint8], distances: NDArray[np.float32]) -> None:
    """Write the distance of each pixel from the nearest pixel of the other side, px.

    Squared distances are whole numbers of 16 bits, of which many fit into a vector.

    Args:
        mask: (H, W), 0 outside and 1 inside.
        distances: written, (H, W): negative inside, between -``FAR_PX`` and ``FAR_PX``.
    """
    height, width = mask.shape
    none, one, far = np.int16(0), np.int16(1), np.int16(_FAR * _FAR)
    columns = np.empty((height, width), np.int16)
    _along_columns(mask, columns)
    # Squared distances, positive inside and negative outside; pixels beyond the border are ignored.
    squares = np.empty(width + 2 * _FAR, np.int16)
    side, best = np.empty(width, np.int16), np.empty(width, np.int16)
    middle = squares[_FAR : _FAR + width]
    for v in range(height):
        column, inside = columns[v], mask[v]
        for u in range(width):
            sign = one if inside[_index(u)] != 0 else np.int16(-one)
            square = np.int16(column[_index(u)] * column[_index(u)])
            side[_index(u)], best[_index(u)] = sign, square
            middle[_index(u)] = np.int16(sign * square)
        for u in range(_FAR):
            squares[u] = np.int16(far * side[0])
            squares[_FAR + width + u] = np.int16(far * side[width - 1])
        for u in range(width):
            sign, now = side[_index(u)], best[_index(u)]
            # The compiler unrolls this loop and vectorizes the outer one.
            for k in range(1, _FAR):
                one_way = np.int16(sign * squares[_index(u + _FAR - k)])
                other_way = np.int16(sign * squares[_index(u + _FAR + k)])
                nearer = one_way if one_way < other_way else other_way
                # The pixel itself is of the other side, so it is the nearest one.
                nearer = np.int16((nearer if nearer > none else none) + np.int16(k * k))
                now = nearer if nearer < now else now
            best[_index(u)] = now
        row = distances[v]
        for u in range(width):
            row[_index(u)] = _SIGNED[_index(_FAR * _FAR + side[_index(u)] * best[_index(u)])]


@kernel
def _along_columns(mask: NDArray[np.uint8], distances: NDArray[np.int16]) -> None:
    """Write the vertical distance to the nearest pixel of the other side, px."""
    height, width = mask.shape
    one, far = np.int16(1), np.int16(_FAR)
    # The distances of the previous row, in an array of its own that the compiler can tell apart.
    last = np.empty(width, np.int16)
    for u in range(width):
        last[_index(u)], distances[0, _index(u)] = far, far
    for v in range(1, height):
        here, above, inside = distances[v], mask[v - 1], mask[v]
        for u in range(width):
            farther = np.int16(last[_index(u)] + one)
            farther = farther if farther < far else far
            farther = farther if inside[_index(u)] == above[_index(u)] else one
            last[_index(u)], here[_index(u)] = farther, farther
    for v in range(height - 2, -1, -1):
        here, below, inside = distances[v], mask[v + 1], mask[v]
        for u in range(width):
            farther = np.int16(last[_index(u)] + one)
            farther = farther if inside[_index(u)] == below[_index(u)] else one
            now = here[_index(u)]
            farther = farther if farther < now else now
            last[_index(u)], here[_index(u)] = farther, farther
