"""Compiled cumulative sums along the rows of a silhouette, from which the costs are computed.

With f = 1 for foreground and 0 for background, row v of the row sums is

    S(v, 0) = 0,    S(v, u + 1) = S(v, u) + 1 - 2 f(v, u)

The sum of (1 - 2 f) over the columns a <= u < b is S(v, b) - S(v, a).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import inlined_kernel, kernel

RowSums = NDArray[np.signedinteger[Any]]
"""Shape (rows, W + 1), of 16 bits if the image is narrow enough, else of 32 bits."""

_FOREGROUND = np.uint64(0xFFFFFFFFFFFFFFFF)
# With an unsigned index, numba compiles no code for negative indices.
_index = np.uint64


@inlined_kernel
def _count_on(
    row_sums: RowSums, v: int, u: np.uint64, count: int, sums: np.int32, step: np.int32
) -> None:
    """Write the ``count`` entries of row ``v`` that follow ``sums`` in column ``u``."""
    for i in range(count):
        row_sums[v, u + _index(i) + _index(1)] = np.int32(sums + step + np.int32(i) * step)


@kernel
def fill_row_sums(
    silhouette: NDArray[np.uint8], words: NDArray[np.uint64], row_sums: RowSums
) -> int:
    """Write the row sums of a silhouette (rows, W), 0 or 255; return its foreground, px.

    ``words`` is the same memory as (rows, W / 8) of 64 bits, so that eight equal pixels are counted
    at a time; with (rows, 0) each pixel is counted by itself.
    """
    rows, width = silhouette.shape
    total = 0
    for v in range(_index(rows)):
        sums = np.int64(0)
        row_sums[v, 0] = 0
        u = _index(0)
        w, n = _index(0), _index(words.shape[1])
        while w < n:
            word = words[v, w]
            begin = w
            w += _index(1)
            if word == _index(0) or word == _FOREGROUND:
                while w < n and words[v, w] == word:
                    w += _index(1)
                step = 1 if word == _index(0) else -1
                count = int(w - begin) * 8
                _count_on(row_sums, v, u, count, np.int32(sums), np.int32(step))
                sums += count * step
                u += _index(count)
            else:
                for _ in range(8):
                    sums += 1 - 2 * (silhouette[v, u] != 0)
                    u += _index(1)
                    row_sums[v, u] = sums
        while u < _index(width):
            sums += 1 - 2 * (silhouette[v, u] != 0)
            u += _index(1)
            row_sums[v, u] = sums
        total += (width - sums) // 2
    return total
