"""Distinguishes shadows from dark clothes by their soft edge.

Both darken the wall without changing its colour. But cloth ends within a pixel or two, and a shadow
fades over many. The background is therefore flooded, pixel by pixel, into dark pixels where the
relative brightness changes slowly. The flood covers a shadow and stops at the outline of cloth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import copied_kernel, kernel
from cardbox_tracker.segmentation.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Temporary value of a shadow candidate, besides 0 (background) and 255 (foreground).
_DARK = 128
# Half the width of the square in which the brightness is compared, px.
_REACH_PX = 2


def decide_shadows(
    foreground: ImageArray,
    difference: FloatImage,
    per_level: FloatImage,
    colored: ImageArray | None,
    darkest: float,
    softest: float,
    window: Window | None = None,
) -> None:
    """Add coloured pixels to ``foreground`` and remove soft shadows from it, in place.

    The foreground (H, W), 0 or 255, was found by brightness alone. The darkness of a pixel is its
    ``difference`` from the background, (H, W), grey levels, times ``per_level``, one of these as a
    fraction of the background. ``colored`` is 255 where the colour differs, of the window's size;
    None without colour. A shadow is at most ``darkest``, and varies around a pixel by ``softest``
    at most. ``window`` contains all foreground; its columns are multiples of 8 if the width is one.

    Raises ValueError if the arrays differ in shape or type, one is read-only, or the window is not
    in the image.
    """
    check_array("foreground", foreground, (ANY, ANY), is_written=True)
    height, width = shape = foreground.shape
    window = window or Window(0, height, 0, width)
    check_array("difference", difference, shape, np.float32, is_written=True)
    check_array("per_level", per_level, shape, np.float32, is_written=True)
    sides = window.bottom - window.top, window.right - window.left
    if colored is not None:
        check_array("colored", colored, sides)
    window.check_within(shape, 1 if width % 8 else 8)
    by_color = np.zeros(sides, np.uint8) if colored is None else colored
    decide_pixels(foreground, by_color, difference, per_level, -darkest, softest, *window)


@copied_kernel
def _is_soft(difference: Any, per_level: Any, v: Any, u: Any, softest: Any) -> Any:
    """Return whether the darkness varies by less than ``softest`` in the square around a pixel."""
    height, width = difference.shape
    reach = _REACH_PX
    low = high = difference[v, u] * per_level[v, u]
    # Within the image the loops have a fixed length.
    if reach <= v < height - reach and reach <= u < width - reach:
        for i in range(2 * reach + 1):
            for k in range(2 * reach + 1):
                value = difference[v + i - reach, u + k - reach]
                value *= per_level[v + i - reach, u + k - reach]
                low, high = min(low, value), max(high, value)
            if high - low >= softest:
                return False
        return True
    for y in range(max(v - reach, 0), min(v + reach + 1, height)):
        for x in range(max(u - reach, 0), min(u + reach + 1, width)):
            value = difference[y, x] * per_level[y, x]
            low, high = min(low, value), max(high, value)
    return high - low < softest


@kernel
def decide_pixels(
    foreground: Any,
    colored: Any,
    difference: Any,
    per_level: Any,
    darkest: Any,
    softest: Any,
    top: Any,
    bottom: Any,
    left: Any,
    right: Any,
) -> None:
    """Do what :func:`decide_shadows` does with the same arguments and the edges of a window."""
    height, width = foreground.shape
    dark, darkest, softest = np.uint8(_DARK), np.float32(darkest), np.float32(softest)
    # Row and first column of each eight pixels with candidates.
    begins = np.empty(2 * (bottom - top) * ((right - left + 7) // 8), np.int32)
    chunks = 0
    words = colored_words = np.empty((0, 0), np.uint64)
    if width % 8 == 0:
        words, colored_words = foreground.view(np.uint64), colored.view(np.uint64)
    for v in range(top, bottom):
        if width % 8 == 0:
            # Eight pixels are processed at a time; coloured ones are no candidates.
            seen, added = words[v, left // 8 : right // 8], colored_words[v - top]
            unexplained = np.uint64(0)
            for k in range(len(seen)):
                unexplained |= seen[k] & ~added[k]
                seen[k] |= added[k]
            if unexplained == 0:
                continue
            darker, level = difference[v, left:right], per_level[v, left:right]
            for k in range(len(seen)):
                if seen[k] != added[k] and _mark_word(seen, added, darker, level, darkest, k):
                    begins[2 * chunks], begins[2 * chunks + 1] = v, left + 8 * k
                    chunks += 1
        else:
            row, by_color = foreground[v, left:right], colored[v - top]
            darker, level = difference[v, left:right], per_level[v, left:right]
            for start in range(0, right - left, 8):
                size = min(8, right - left - start)
                if _mark(row, by_color, darker, level, darkest, start, size):
                    begins[2 * chunks], begins[2 * chunks + 1] = v, left + start
                    chunks += 1
    # The flood starts at the background and spreads as far as the shadow is soft.
    rows, columns = np.empty(8 * chunks, np.int32), np.empty(8 * chunks, np.int32)
    count = 0
    for chunk in range(chunks):
        v, start = begins[2 * chunk], begins[2 * chunk + 1]
        for u in range(start, min(start + 8, right)):
            if foreground[v, u] == dark and (
                (v > 0 and foreground[v - 1, u] == 0)
                or (v + 1 < height and foreground[v + 1, u] == 0)
                or (u > 0 and foreground[v, u - 1] == 0)
                or (u + 1 < width and foreground[v, u + 1] == 0)
            ):
                is_soft = _is_soft(difference, per_level, v, u, softest)
                if is_soft:
                    foreground[v, u] = 0
                    rows[count], columns[count] = v, u
                    count += 1
    begin = 0
    while begin < count:
        v, u = rows[begin], columns[begin]
        begin += 1
        for k in range(4):
            y = v + (k == 0) - (k == 1)
            x = u + (k == 2) - (k == 3)
            if y < 0 or y >= height or x < 0 or x >= width or foreground[y, x] != dark:
                continue
            if _is_soft(difference, per_level, y, x, softest):
                foreground[y, x] = 0
                rows[count], columns[count] = y, x
                count += 1
    # Near the outline the square reaches into the person, so the last pixels skip this test.
    begin = 0
    for _ in range(_REACH_PX):
        last = count
        for index in range(begin, last):
            v, u = rows[index], columns[index]
            for k in range(4):
                y = v + (k == 0) - (k == 1)
                x = u + (k == 2) - (k == 3)
                inside = y >= 0 and y < height and x >= 0 and x < width
                if inside and foreground[y, x] == dark:
                    foreground[y, x] = 0
                    rows[count], columns[count] = y, x
                    count += 1
        begin = last
    for chunk in range(chunks):
        v, start = begins[2 * chunk], begins[2 * chunk + 1]
        for u in range(start, min(start + 8, right)):
            foreground[v, u] = 255 * (foreground[v, u] > 0)


@copied_kernel
def _mark(
    row: Any, by_color: Any, difference: Any, per_level: Any, darkest: Any, start: Any, size: Any
) -> Any:
    """Add coloured pixels to a row, mark candidates, and return whether there are any."""
    dark, zero = np.uint8(_DARK), np.float32(0)
    found = np.uint8(0)
    for k in range(size):
        u = start + k
        darker = difference[u] * per_level[u]
        seen = row[u] | by_color[u]
        is_dark = (seen > by_color[u]) & (darkest < darker) & (darker < zero)
        row[u] = dark if is_dark else seen
        found |= np.uint8(is_dark)
    return found > 0


@copied_kernel
def _mark_word(
    seen: Any, by_color: Any, difference: Any, per_level: Any, darkest: Any, place: Any
) -> Any:
    """Mark candidates among eight pixels of a row, and return whether there are any.

    The numbers ``seen`` and ``by_color`` have eight pixels each, the others one.
    """
    found = np.uint64(0)
    for k in range(8):
        darker = difference[8 * place + k] * per_level[8 * place + k]
        is_dark = (darkest < darker) & (darker < np.float32(0))
        # The highest bit of a pixel is the value of a candidate.
        found |= np.uint64(is_dark) << np.uint64(8 * k + 7)
    found &= seen[place] & ~by_color[place]
    # From 255 to 128.
    seen[place] ^= found - (found >> np.uint64(7))
    return found > 0
