"""Compiled sums of (1 - 2 f) over the union of patches, drawn as bits of :mod:`.bit_planes`.

No step depends on the order of the patches in a row.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import (
    borrowing_kernel,
    index,
    inlined_allocation,
    inlined_kernel,
)
from cardbox_tracker.terms.bit_planes import (
    COUNTED,
    FOREGROUND,
    PIXELS,
    ROWS,
    Planes,
    count_bits,
    left_of,
    padded,
)
from cardbox_tracker.terms.kernel_arguments import Counts, Whole
from cardbox_tracker.terms.rasterisation import Workspace

# Rounding moves a crossing by far less than this beyond the corners of its patch, px.
_MARGIN_PX = 1.0

Drawn = NDArray[np.uint32]

_padded = inlined_kernel(padded)


class Masks(NamedTuple):
    """Scratch arrays for K patches."""

    drawn: Drawn  #: pixels of the union, (words, rows); rows outside of ``rows_of`` have no meaning
    words_of: Counts  #: first and end column of words of each patch, (K, 2)
    rows_of: Counts  #: first and end row of each column of words, (words, 2)


@inlined_allocation
def new_masks(patches: int, planes: Planes) -> Masks:
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
    for w in range(index(words)):
        rows_of[w, 0], rows_of[w, 1] = drawn.shape[1], 0
    for k in range(index(patches)):
        first, last = extent[k, 0], extent[k, 1]
        left, right = 0.0, float(width)
        # Corners behind the near plane have no place in the image.
        if not has_cuts:
            a, b = pixels[0, k], pixels[0, k + index(patches)]
            c, d = pixels[0, k + index(2 * patches)], pixels[0, k + index(3 * patches)]
            left = max(left, min(min(a, b), min(c, d)) - _MARGIN_PX)
            right = min(right, max(max(a, b), max(c, d)) + _MARGIN_PX)
        begin = end = 0
        if first < last and left < right:
            begin, end = int(left / PIXELS), min(int(right / PIXELS) + 1, words)
        words_of[k, 0], words_of[k, 1] = begin, end
        for w in range(index(begin), index(end)):
            rows_of[w, 0], rows_of[w, 1] = min(rows_of[w, 0], first), max(rows_of[w, 1], last)
    for w in range(index(words)):
        for v in range(index(rows_of[w, 0]), index(rows_of[w, 1])):
            drawn[w, v] = np.uint32(0)


@borrowing_kernel
def _add(sides: Whole, extent: Counts, words_of: Counts, drawn: Drawn) -> None:
    """Add all patches with their ``extent`` (K, 2) and columns of words (K, 2)."""
    for k in range(index(extent.shape[0])):
        first, count = np.int32(extent[k, 0]), np.uint32(extent[k, 1] - extent[k, 0])
        begin, end = extent[k, 0] // ROWS, _padded(extent[k, 1]) // ROWS
        for w in range(index(words_of[k, 0]), index(words_of[k, 1])):
            column = np.int32(PIXELS) * np.int32(w)
            for group in range(index(begin), index(end)):
                # A constant number of rows is vectorized without a remainder.
                for i in range(ROWS):
                    v = group * index(ROWS) + index(i)
                    one = left_of(sides[k, 0, v], column)
                    other = left_of(sides[k, 1, v], column)
                    # The sides are in any order, and those of other rows are undefined.
                    is_inside = np.uint32(np.int32(v) - first) < count
                    added = np.uint32(one ^ other) if is_inside else np.uint32(0)
                    drawn[w, v] = np.uint32(drawn[w, v] | added)


@borrowing_kernel
def _count(drawn: Drawn, rows_of: Counts, planes: Planes) -> tuple[int, int]:
    """Return drawn pixels and their sum of (1 - 2 f)."""
    pixels = gain = 0
    for w in range(index(drawn.shape[0])):
        area, counted, seen = np.int32(0), np.int32(0), np.int32(0)
        for v in range(index(rows_of[w, 0]), index(rows_of[w, 1])):
            word = drawn[w, v]
            area = np.int32(area + count_bits(word))
            counted = np.int32(counted + count_bits(np.uint32(word & planes[COUNTED, w, v])))
            seen = np.int32(seen + count_bits(np.uint32(word & planes[FOREGROUND, w, v])))
        pixels += int(area)
        gain += int(counted) - 2 * int(seen)
    return pixels, gain


@inlined_kernel
def sum_masks(
    work: Workspace, has_cuts: bool, width: int, planes: Planes, masks: Masks
) -> tuple[int, int]:
    """Return sum of (1 - 2 f) and area, px, of the union of all patches of ``work``.

    Their sides have as many rows as the ``planes`` (2, words, rows), see
    :func:`~.bit_planes.fill_planes`. ``has_cuts`` is from :func:`~.rasterisation.draw`; ``masks``
    are scratch arrays for as many patches.
    """
    _place(work, has_cuts, width, masks)
    _add(work.sides, work.extent, masks.words_of, masks.drawn)
    area, gain = _count(masks.drawn, masks.rows_of, planes)
    return gain, area


@inlined_kernel
def cover_masks(masks: Masks, planes: Planes, covered: Planes) -> None:
    """Write the planes to ``covered`` without the pixels of the last union."""
    drawn, rows_of = masks.drawn, masks.rows_of
    for w in range(index(drawn.shape[0])):
        for v in range(index(drawn.shape[1])):
            covered[COUNTED, w, v] = planes[COUNTED, w, v]
            covered[FOREGROUND, w, v] = planes[FOREGROUND, w, v]
        for v in range(index(rows_of[w, 0]), index(rows_of[w, 1])):
            covered[COUNTED, w, v] &= ~drawn[w, v]
            covered[FOREGROUND, w, v] &= ~drawn[w, v]
