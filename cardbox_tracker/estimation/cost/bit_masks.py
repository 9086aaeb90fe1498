"""Compiled sums of (1 - 2 f) over the union of many patches, which are drawn as bits.

Where many patches overlap, bits are faster than runs of columns (:mod:`.union`), because no step
depends on the order of the patches in a row. The results are equal.

A word has 31 pixels of one row, so that a shift by the number of pixels before a column is always
below 32. The words of one column of words are consecutive in memory, so that the loops over rows
can be vectorized; their rows are padded to a multiple of 16 for the same reason.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from cardbox_tracker.compiling import inlined_kernel, kernel
from cardbox_tracker.estimation.cost.kernel_arguments import Counts, Whole
from cardbox_tracker.estimation.cost.rasterisation import Workspace
from cardbox_tracker.estimation.cost.row_sums import RowSums

Words = NDArray[np.uint32]

_PIXELS, _ROWS = 31, 16
# Rounding moves a crossing by far less than this beyond the corners of its patch, px.
_MARGIN_PX = 1.0

# With an unsigned index, numba compiles no code for negative indices.
_index = np.uint64
_Index = int | np.integer[Any]


class Masks(NamedTuple):
    """Scratch arrays for K patches.

    Attributes:
        drawn: pixels of the union, (words, rows); rows outside of ``rows_of`` have no meaning.
        words_of: first and end column of words of each patch, (K, 2).
        rows_of: first and end row of each column of words, (words, 2).
    """

    drawn: Words
    words_of: Counts
    rows_of: Counts


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


_below: Any = intrinsic(_low_bits)
"""Compiled function: a word (uint32) whose lowest bits are set, as many (int32) as given, 0..31."""

_count_bits: Any = intrinsic(_set_bits)
"""Compiled function: the number (int32) of bits of a word (uint32) that are set."""


def padded(rows: int) -> int:
    """Return a number of rows, rounded up to that of the loops."""
    return (rows + _ROWS - 1) // _ROWS * _ROWS


_padded = inlined_kernel(padded)


def new_planes(width: int, rows: int) -> Words:
    """Allocate the planes of :func:`fill_planes` for images of up to this size, px."""
    return np.zeros((2, (width + _PIXELS - 1) // _PIXELS, padded(rows)), np.uint32)


@kernel
def fill_planes(row_sums: RowSums, planes: Words) -> None:
    """Write the pixels that count, and the foreground among them, of (rows, W + 1) row sums.

    Args:
        row_sums: running sums of 1 - 2 f, which do not change over a pixel that does not count.
        planes: (2, words, rows or more), written.
    """
    width, words = row_sums.shape[1] - 1, planes.shape[1]
    for v in range(_index(row_sums.shape[0])):
        for w in range(_index(words)):
            begin = w * _index(_PIXELS)
            pixels = min(_PIXELS, width - int(begin))
            change = int(row_sums[v, begin + _index(pixels)]) - int(row_sums[v, begin])
            counted = seen = np.uint32(0)
            if change == pixels or change == -pixels:
                counted = _below(np.int32(pixels))
                seen = counted if change < 0 else seen
            else:
                for i in range(pixels):
                    column = begin + _index(i)
                    step = int(row_sums[v, column + _index(1)]) - int(row_sums[v, column])
                    counted |= np.uint32(step != 0) << np.uint32(i)
                    seen |= np.uint32(step < 0) << np.uint32(i)
            planes[0, w, v] = counted
            planes[1, w, v] = seen


@inlined_kernel
def new_masks(patches: int, planes: Words) -> Masks:
    """Return the scratch arrays for a number of patches before the planes (2, words, rows)."""
    words, rows = planes.shape[1:]
    return Masks(
        drawn=np.empty((words, rows), np.uint32),
        words_of=np.empty((patches, 2), np.int64),
        rows_of=np.empty((words, 2), np.int64),
    )


@inlined_kernel
def _place(work: Workspace, has_cuts: bool, width: int, masks: Masks) -> None:
    """Write the words of each patch, and the rows of each column of words, which are cleared."""
    pixels, extent = work.pixels, work.extent
    drawn, words_of, rows_of = masks.drawn, masks.words_of, masks.rows_of
    patches, words = extent.shape[0], drawn.shape[0]
    for w in range(_index(words)):
        rows_of[w, 0], rows_of[w, 1] = drawn.shape[1], 0
    for k in range(_index(patches)):
        first, last = extent[k, 0], extent[k, 1]
        left, right = 0.0, float(width)
        # Corners behind the near plane have no place in the image.
        if not has_cuts:
            a, b = pixels[0, k], pixels[0, k + _index(patches)]
            c, d = pixels[0, k + _index(2 * patches)], pixels[0, k + _index(3 * patches)]
            left = max(left, min(min(a, b), min(c, d)) - _MARGIN_PX)
            right = min(right, max(max(a, b), max(c, d)) + _MARGIN_PX)
        begin = end = 0
        if first < last and left < right:
            begin, end = int(left / _PIXELS), min(int(right / _PIXELS) + 1, words)
        words_of[k, 0], words_of[k, 1] = begin, end
        for w in range(_index(begin), _index(end)):
            rows_of[w, 0], rows_of[w, 1] = min(rows_of[w, 0], first), max(rows_of[w, 1], last)
    for w in range(_index(words)):
        for v in range(_index(rows_of[w, 0]), _index(rows_of[w, 1])):
            drawn[w, v] = np.uint32(0)


@inlined_kernel
def _below_column(column: np.int32, begin: np.int32) -> np.uint32:
    """Return the pixels of the word that starts at ``begin`` that are left of a column."""
    within = np.int32(min(max(np.int32(column - begin), np.int32(0)), np.int32(_PIXELS)))
    pixels: np.uint32 = _below(within)
    return pixels


@kernel
def _add(sides: Whole, k: _Index, extent: Counts, words: Counts, drawn: Words) -> None:
    """Add patch ``k`` with its ``extent`` (2,) and its columns of ``words`` (2,)."""
    first, count = np.int32(extent[0]), np.uint32(extent[1] - extent[0])
    begin, end = extent[0] // _ROWS, _padded(extent[1]) // _ROWS
    for w in range(_index(words[0]), _index(words[1])):
        column = np.int32(_PIXELS) * np.int32(w)
        for group in range(_index(begin), _index(end)):
            # A constant number of rows is vectorized without a remainder.
            for i in range(_ROWS):
                v = group * _index(_ROWS) + _index(i)
                one = _below_column(sides[k, 0, v], column)
                other = _below_column(sides[k, 1, v], column)
                # The sides are in any order, and those of other rows are undefined.
                is_inside = np.uint32(np.int32(v) - first) < count
                added = np.uint32(one ^ other) if is_inside else np.uint32(0)
                drawn[w, v] = np.uint32(drawn[w, v] | added)


@kernel
def _count(drawn: Words, w: _Index, rows: Counts, planes: Words) -> tuple[int, int]:
    """Return drawn pixels and their sum of (1 - 2 f), in ``rows`` (2,) of a column of words."""
    area, counted, seen = np.int32(0), np.int32(0), np.int32(0)
    for v in range(_index(rows[0]), _index(rows[1])):
        word = drawn[w, v]
        area = np.int32(area + _count_bits(word))
        counted = np.int32(counted + _count_bits(np.uint32(word & planes[0, w, v])))
        seen = np.int32(seen + _count_bits(np.uint32(word & planes[1, w, v])))
    return int(area), int(counted) - 2 * int(seen)


@inlined_kernel
def sum_masks(
    work: Workspace, has_cuts: bool, width: int, planes: Words, masks: Masks
) -> tuple[int, int]:
    """Return sum of (1 - 2 f) and area, px, of the union of all patches.

    Args:
        work: the patches, with sides of as many rows as the planes.
        has_cuts: whether a corner is behind the near plane, from :func:`~.rasterisation.draw`.
        width: width of the image, px.
        planes: (2, words, rows), see :func:`fill_planes`.
        masks: scratch arrays for as many patches.
    """
    _place(work, has_cuts, width, masks)
    drawn, words_of, rows_of = masks.drawn, masks.words_of, masks.rows_of
    for k in range(_index(work.extent.shape[0])):
        if words_of[k, 0] < words_of[k, 1]:
            _add(work.sides, k, work.extent[k], words_of[k], drawn)
    gain = area = 0
    for w in range(_index(drawn.shape[0])):
        if rows_of[w, 0] < rows_of[w, 1]:
            pixels, change = _count(drawn, w, rows_of[w], planes)
            area += pixels
            gain += change
    return gain, area
