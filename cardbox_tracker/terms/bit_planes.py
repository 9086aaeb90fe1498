"""A silhouette as bits: the pixels that count, and the foreground among them.

A word has 31 pixels of one row, so that a shift by the number of pixels before a column is always
below 32; its lowest bit is the left pixel. The words of one column of words are consecutive in
memory, so that loops over rows can be vectorized; their rows are padded to a multiple of 16 for the
same reason. Both planes need a quarter of the memory of the silhouette.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import Index, index, inlined_kernel, kernel
from cardbox_tracker.segmentation.regions import LOW_BITS

Planes = NDArray[np.uint32]
"""Shape (2, words, rows): pixels that count, and foreground among them."""

COUNTED, FOREGROUND = 0, 1
"""Planes."""
PIXELS, ROWS = 31, 16
"""Pixels of a word, and rows of a group."""
_LOW_BYTES = np.uint64(0x7F7F7F7F7F7F7F7F)
_GATHER = np.uint64(0x0102040810204080)


def _low_bits(typing_context: Any, count: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (value,) = arguments
        one = value.type(1)
        return builder.sub(builder.shl(one, value), one)

    return types.uint32(types.int32), generate


def _set_bits(typing_context: Any, word: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return types.int32(types.uint32), generate


below: Any = intrinsic(_low_bits)
"""Compiled function: a word (uint32) whose lowest bits are set, as many (int32) as given, 0..31."""

count_bits: Any = intrinsic(_set_bits)
"""Compiled function: the number (int32) of bits of a word (uint32) that are set."""


def padded(rows: int) -> int:
    """Return a number of rows, rounded up to full groups."""
    return (rows + ROWS - 1) // ROWS * ROWS


def new_planes(width: int, rows: int) -> Planes:
    """Allocate planes for images of this width and up to so many rows, px."""
    return np.zeros((2, (width + PIXELS - 1) // PIXELS, padded(rows)), np.uint32)


@inlined_kernel
def left_of(column: np.int32, begin: np.int32) -> np.uint32:
    """Return the pixels left of a column in the word that begins at the column ``begin``."""
    within = np.int32(min(max(np.int32(column - begin), np.int32(0)), np.int32(PIXELS)))
    pixels: np.uint32 = below(within)
    return pixels


@inlined_kernel
def _eight_bits(pixels: np.uint64) -> np.uint64:
    """Return one bit for each byte, 1 if it is not zero; the first pixel's is the lowest."""
    is_set = ((pixels & _LOW_BYTES) + _LOW_BYTES) | pixels
    bits: np.uint64 = (((is_set >> index(7)) & LOW_BITS) * _GATHER) >> index(56)
    return bits


@kernel
def fill_planes(silhouette: NDArray[np.uint8], words: NDArray[np.uint64], planes: Planes) -> int:
    """Write a silhouette (rows, W), not 0 in the foreground; return its foreground, px.

    ``words`` is the same memory as (rows, W / 8) of 64 bits, so that eight pixels are read at a
    time; with (rows, 0) each pixel is read by itself. ``planes`` (2, words, rows or more) is
    written.
    """
    rows, width = silhouette.shape
    last = planes.shape[1] - 1
    for column in range(index(last + 1)):
        pixels = below(np.int32(PIXELS if column < index(last) else width - PIXELS * last))
        for v in range(index(rows)):
            planes[COUNTED, column, v] = pixels
    # Eight pixels of a row in each number; a word is a part of five numbers.
    eights = np.zeros((width + 7) // 8 + 5, np.uint64)
    total = 0
    for v in range(index(rows)):
        for i in range(index(words.shape[1])):
            eights[i] = _eight_bits(words[v, i])
        if words.shape[1] == 0:
            eights[:] = 0
            for u in range(index(width)):
                bit = index(silhouette[v, u] != 0) << (u & index(7))
                eights[u >> index(3)] |= bit
        for w in range(index(last + 1)):
            first = w * index(PIXELS)
            at = first >> index(3)
            five = eights[at] | eights[at + index(1)] << index(8)
            five |= eights[at + index(2)] << index(16) | eights[at + index(3)] << index(24)
            five |= eights[at + index(4)] << index(32)
            planes[FOREGROUND, w, v] = (five >> (first & index(7))) & index(2**PIXELS - 1)
    for column in range(index(last + 1)):
        for v in range(index(rows)):
            total += count_bits(planes[FOREGROUND, column, v])
    return total


@kernel
def leave_out(planes: Planes, first_row: int, end_row: int, start: int, end: int) -> int:
    """Let these rows and columns, those of legs, no longer count; return their foreground, px."""
    taken = 0
    for w in range(index(planes.shape[1])):
        column = np.int32(PIXELS) * np.int32(w)
        within = np.uint32(left_of(np.int32(start), column) ^ left_of(np.int32(end), column))
        if within:
            for v in range(index(first_row), index(end_row)):
                taken += count_bits(np.uint32(planes[FOREGROUND, w, v] & within))
                planes[COUNTED, w, v] &= ~within
                planes[FOREGROUND, w, v] &= ~within
    return taken


@inlined_kernel
def value_at(planes: Planes, v: Index, u: Index) -> int:
    """Return 1 - 2 f of the pixel in row ``v`` and column ``u``; 0 if it does not count."""
    w, bit = index(u) // index(PIXELS), np.uint32(index(u) % index(PIXELS))
    counted = (planes[COUNTED, w, index(v)] >> bit) & np.uint32(1)
    seen = (planes[FOREGROUND, w, index(v)] >> bit) & np.uint32(1)
    return int(counted) - 2 * int(seen)


@kernel
def median_column(planes: Planes, rows: int, width: int) -> float:
    """Return the median column of the foreground, from every 8th row and every 4th column, px."""
    counts = np.zeros(width // 4 + 1, np.int64)
    words = planes.shape[1]
    total = 0
    for v in range(0, rows, 8):
        for w in range(words):
            # Four pixels that begin in a word may end in the next one; most words are empty.
            following = planes[FOREGROUND, min(w + 1, words - 1), v]
            if planes[FOREGROUND, w, v] == 0 and following == 0:
                continue
            pair = index(planes[FOREGROUND, w, v]) | index(following) << index(PIXELS)
            both = planes[COUNTED, w, v], planes[COUNTED, min(w + 1, words - 1), v]
            counted = index(both[0]) | index(both[1]) << index(PIXELS)
            begin, end = (PIXELS * w + 3) // 4, (PIXELS * (w + 1) + 3) // 4
            for i in range(begin, min(end, width // 4)):
                shift = index(4 * i - PIXELS * w)
                four = count_bits(np.uint32((counted >> shift) & index(15)))
                if 2 * count_bits(np.uint32((pair >> shift) & index(15))) > four:
                    counts[i] += 1
                    total += 1
    seen = 0
    for i in range(counts.shape[0]):
        seen += counts[i]
        if 2 * seen >= total:
            return 4.0 * i + 2.0
    middle: float = width / 2.0
    return middle
