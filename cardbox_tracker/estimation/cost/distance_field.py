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


@kernel
def signed_distances_of(mask: NDArray[np.uint8], distances: NDArray[np.float32]) -> None:
    """Write the distance of each pixel from the nearest pixel of the other side, px.

    Args:
        mask: (H, W), 0 outside and 1 inside.
        distances: written, (H, W): negative inside, between -``FAR_PX`` and ``FAR_PX``.
    """
    height, width = mask.shape
    none, one, far = np.float32(0.0), np.float32(1.0), np.float32(_FAR)
    columns = np.empty((height, width), np.float32)
    _along_columns(mask, columns)
    # Squared distances, positive inside and negative outside; pixels beyond the border are ignored.
    squares = np.empty(width + 2 * _FAR, np.float32)
    side, best = np.empty(width, np.float32), np.empty(width, np.float32)
    middle = squares[_FAR : _FAR + width]
    for v in range(height):
        column, inside = columns[v], mask[v]
        for u in range(width):
            sign = one if inside[_index(u)] != 0 else -one
            square = column[_index(u)] * column[_index(u)]
            side[_index(u)], best[_index(u)] = sign, square
            middle[_index(u)] = sign * square
        for u in range(_FAR):
            squares[u] = far * far * side[0]
            squares[_FAR + width + u] = far * far * side[width - 1]
        for k in range(1, _FAR):
            apart = np.float32(k * k)
            before = squares[_FAR - k : _FAR - k + width]
            after = squares[_FAR + k : _FAR + k + width]
            for u in range(width):
                sign = side[_index(u)]
                one_way, other_way = sign * before[_index(u)], sign * after[_index(u)]
                nearer = one_way if one_way < other_way else other_way
                # The pixel itself is of the other side, so it is the nearest one.
                nearer = (nearer if nearer > none else none) + apart
                now = best[_index(u)]
                best[_index(u)] = nearer if nearer < now else now
        row = distances[v]
        for u in range(width):
            row[_index(u)] = -side[_index(u)] * np.sqrt(best[_index(u)])


@kernel
def _along_columns(mask: NDArray[np.uint8], distances: NDArray[np.float32]) -> None:
    """Write the vertical distance to the nearest pixel of the other side, px."""
    height, width = mask.shape
    one, far = np.float32(1.0), np.float32(_FAR)
    for u in range(width):
        distances[0, _index(u)] = far
    for v in range(1, height):
        before, here, above, inside = distances[v - 1], distances[v], mask[v - 1], mask[v]
        for u in range(width):
            farther = before[_index(u)] + one
            farther = farther if farther < far else far
            here[_index(u)] = farther if inside[_index(u)] == above[_index(u)] else one
    for v in range(height - 2, -1, -1):
        before, here, below, inside = distances[v + 1], distances[v], mask[v + 1], mask[v]
        for u in range(width):
            farther = before[_index(u)] + one
            farther = farther if inside[_index(u)] == below[_index(u)] else one
            now = here[_index(u)]
            here[_index(u)] = farther if farther < now else now
