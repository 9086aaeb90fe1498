"""Distinguishes shadows from dark clothes by their soft edge.

Both darken the wall without changing its colour. But cloth ends within a pixel or two, and a shadow
fades over many. The background is therefore flooded, pixel by pixel, into dark pixels where the
relative brightness changes slowly. The flood covers a shadow and stops at the outline of cloth.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.vision.array_checks import ANY, check_array
from cardbox_tracker.vision.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Temporary value of a shadow candidate, besides 0 (background) and 255 (foreground).
_DARK = 128
# Half the width of the square in which the brightness is compared, px.
_REACH_PX = 2


# Eight pixels are processed at a time where the width is a multiple of eight.
_NO_WORDS = np.zeros((1, 0), np.uint64)
_NO_COLOR = np.zeros((0, 0), np.uint8)


class _Darkness(NamedTuple):
    """Difference (H, W) in grey levels, and one grey level (H, W) as a fraction."""

    difference: Any
    per_level: Any


def decide_shadows(
    foreground: ImageArray,
    difference: FloatImage,
    per_level: FloatImage,
    colored: FloatImage | None,
    darkest: float,
    softest: float,
    window: Window | None = None,
) -> None:
    """Add coloured pixels to ``foreground`` and remove soft shadows from it, in place.

    The darkness of a pixel is its difference times ``per_level``, a fraction of the background.

    Args:
        foreground: (H, W), 0 or 255, found by brightness alone.
        difference: image minus background, (H, W), grey levels.
        per_level: one grey level as a fraction of the background, (H, W).
        colored: >= 0 where the colour differs, of the window's size; None without colour.
        darkest: largest darkness of a shadow.
        softest: largest variation of the darkness around a pixel of a shadow.
        window: a window that contains all foreground, whose columns are multiples of 8 if the
            width is one; the whole image if None.

    Raises:
        ValueError: the arrays differ in shape, one is read-only, or the window is not in the image.
    """
    check_array("foreground", foreground, (ANY, ANY), is_written=True)
    height, width = shape = foreground.shape
    window = window or Window(0, height, 0, width)
    check_array("difference", difference, shape, np.float32, is_written=True)
    check_array("per_level", per_level, shape, np.float32, is_written=True)
    if colored is not None:
        sides = window.bottom - window.top, window.right - window.left
        check_array("colored", colored, sides, np.float32)
    window.check_within(shape, 1 if width % 8 else 8)
    part = foreground[window.slices]
    by_color = _NO_COLOR
    if colored is not None:
        by_color = np.asarray(cv2.inRange(colored, 0.0, np.inf), np.uint8)
    # Row and column of the candidates, and of the pixels that were flooded.
    queues = np.empty((4, part.size), np.int32)
    limits = np.float32(-darkest), np.float32(softest)
    words = foreground.view(np.uint64) if foreground.shape[1] % 8 == 0 else _NO_WORDS
    if colored is not None:
        cv2.bitwise_or(part, by_color, dst=part)
    darkness = _Darkness(difference, per_level)
    _decide(foreground, words, darkness, by_color, limits, window, queues)


@njit(cache=True, nogil=True, inline="always")
def _is_soft(darkness: Any, v: Any, u: Any, softest: Any) -> Any:
    """Return whether the darkness varies by less than ``softest`` in the square around a pixel."""
    difference, per_level = darkness
    height, width = difference.shape
    low = high = difference[v, u] * per_level[v, u]
    for y in range(max(v - _REACH_PX, 0), min(v + _REACH_PX + 1, height)):
        for x in range(max(u - _REACH_PX, 0), min(u + _REACH_PX + 1, width)):
            value = difference[y, x] * per_level[y, x]
            low = min(low, value)
            high = max(high, value)
        if high - low >= softest:
            return False
    return True


@njit(cache=True, nogil=True)
def _decide(
    foreground: Any,
    words: Any,
    darkness: Any,
    by_color: Any,
    limits: Any,
    window: Any,
    queues: Any,
) -> None:
    height, width = foreground.shape
    top, bottom, left, right = window
    difference, per_level = darkness
    darkest, softest = limits
    has_color = by_color.shape[0] > 0
    rows, columns = queues[0], queues[1]
    queued_rows, queued_columns = queues[2], queues[3]
    dark = np.uint8(_DARK)
    number = 0
    for v in range(top, bottom):
        start = left
        while start < right:
            end = right
            if words.shape[1] > 0:
                end = start + 8
                if words[v, start // 8] == 0:
                    start = end
                    continue
            for u in range(start, end):
                darker = difference[v, u] * per_level[v, u]
                if foreground[v, u] > 0 and darkest < darker < 0:
                    if has_color and by_color[v - top, u - left] > 0:
                        continue
                    foreground[v, u] = dark
                    rows[number], columns[number] = v, u
                    number += 1
            start = end
    # The flood starts at the background and spreads as far as the shadow is soft.
    count = 0
    for index in range(number):
        v, u = rows[index], columns[index]
        outside = (
            (v > 0 and foreground[v - 1, u] == 0)
            or (v + 1 < height and foreground[v + 1, u] == 0)
            or (u > 0 and foreground[v, u - 1] == 0)
            or (u + 1 < width and foreground[v, u + 1] == 0)
        )
        if outside and _is_soft(darkness, v, u, softest):
            foreground[v, u] = 0
            queued_rows[count], queued_columns[count] = v, u
            count += 1
    begin = 0
    while begin < count:
        v, u = queued_rows[begin], queued_columns[begin]
        begin += 1
        for k in range(4):
            y = v + (k == 0) - (k == 1)
            x = u + (k == 2) - (k == 3)
            if y < 0 or y >= height or x < 0 or x >= width or foreground[y, x] != dark:
                continue
            if _is_soft(darkness, y, x, softest):
                foreground[y, x] = 0
                queued_rows[count], queued_columns[count] = y, x
                count += 1
    # Near the outline the square reaches into the person, so the last pixels skip this test.
    begin = 0
    for _ in range(_REACH_PX):
        last = count
        for index in range(begin, last):
            v, u = queued_rows[index], queued_columns[index]
            for k in range(4):
                y = v + (k == 0) - (k == 1)
                x = u + (k == 2) - (k == 3)
                inside = y >= 0 and y < height and x >= 0 and x < width
                if inside and foreground[y, x] == dark:
                    foreground[y, x] = 0
                    queued_rows[count], queued_columns[count] = y, x
                    count += 1
        begin = last
    for index in range(number):
        v, u = rows[index], columns[index]
        if foreground[v, u] == dark:
            foreground[v, u] = 255
