"""Shadows told from dark clothes by their soft edge.

Both are darker than the wall in its own colour. But cloth ends within a pixel or two, and a shadow
fades over many. So the background is let in, pixel by pixel, where the brightness relative to it
changes slowly: it floods a shadow and stops at the outline of cloth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# What a pixel that may be a shadow is meanwhile, besides 0 (background) and 255 (foreground).
_DARK = 128
# Half the width of the square in which the brightness is compared.
_REACH_PX = 2


# Eight pixels at a time, where rows are made of such.
_NO_WORDS = np.zeros((1, 0), np.uint64)
_ALL_WHITE = np.uint64(0xFFFFFFFFFFFFFFFF)
_NOTHING = np.full((1, 1), -1, np.float32)


def decide_shadows(
    foreground: ImageArray,
    difference: FloatImage,
    per_level: FloatImage,
    colored: FloatImage | None,
    darkest: float,
    softest: float,
) -> None:
    """Add what the colour finds to ``foreground`` and take soft shadows away, in place.

    A pixel is darker by its difference times its ``per_level``, a fraction of the background.

    Args:
        foreground: (H, W), 0 or 255, by brightness alone.
        difference: image minus background, (H, W), grey levels.
        per_level: one grey level as a fraction of the background, (H, W).
        colored: not negative where the colour differs, (H, W); None without colour.
        darkest: a shadow is darker by less than this fraction.
        softest: around a pixel of a shadow, that fraction varies by less than this.
    """
    margin = _NOTHING if colored is None else colored
    queues = np.empty((2, foreground.size), np.int32)
    limits = np.float32(-darkest), np.float32(softest)
    words = foreground.view(np.uint64) if foreground.shape[1] % 8 == 0 else _NO_WORDS
    has_color = colored is not None
    _decide(foreground, words, difference, per_level, margin, has_color, limits, queues)


@njit(cache=True, nogil=True, inline="always")
def _is_soft(difference: Any, per_level: Any, v: Any, u: Any, softest: Any) -> Any:
    """Whether the darkness varies by less than ``softest`` in the square around a pixel."""
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
    difference: Any,
    per_level: Any,
    colored: Any,
    has_color: Any,
    limits: Any,
    queues: Any,
) -> None:
    height, width = foreground.shape
    darkest, softest = limits
    candidates, queue = queues[0], queues[1]
    dark = np.uint8(_DARK)
    for v in range(height):
        for u in range(width):
            code = foreground[v, u]
            darker = difference[v, u] * per_level[v, u]
            code = min(code, dark) if darkest < darker < 0 else code
            if has_color:
                code = np.uint8(255) if colored[v, u] >= 0 else code
            foreground[v, u] = code
    number = 0
    for v in range(height):
        u = 0
        while u < width:
            if u % 8 == 0 and u // 8 < words.shape[1]:
                word = words[v, u // 8]
                if word == 0 or word == _ALL_WHITE:
                    u += 8
                    continue
            if foreground[v, u] == dark:
                candidates[number] = v * width + u
                number += 1
            u += 1
    # From the background, as far as the shadow is soft.
    count = 0
    for index in range(number):
        v, u = candidates[index] // width, candidates[index] % width
        outside = (
            (v > 0 and foreground[v - 1, u] == 0)
            or (v + 1 < height and foreground[v + 1, u] == 0)
            or (u > 0 and foreground[v, u - 1] == 0)
            or (u + 1 < width and foreground[v, u + 1] == 0)
        )
        if outside and _is_soft(difference, per_level, v, u, softest):
            foreground[v, u] = 0
            queue[count] = candidates[index]
            count += 1
    begin = 0
    while begin < count:
        v, u = queue[begin] // width, queue[begin] % width
        begin += 1
        for k in range(4):
            y = v + (k == 0) - (k == 1)
            x = u + (k == 2) - (k == 3)
            if y < 0 or y >= height or x < 0 or x >= width or foreground[y, x] != dark:
                continue
            if _is_soft(difference, per_level, y, x, softest):
                foreground[y, x] = 0
                queue[count] = y * width + x
                count += 1
    # Beside the outline the square reaches into the person: those last pixels go without it.
    begin = 0
    for _ in range(_REACH_PX):
        last = count
        for index in range(begin, last):
            v, u = queue[index] // width, queue[index] % width
            for k in range(4):
                y = v + (k == 0) - (k == 1)
                x = u + (k == 2) - (k == 3)
                inside = y >= 0 and y < height and x >= 0 and x < width
                if inside and foreground[y, x] == dark:
                    foreground[y, x] = 0
                    queue[count] = y * width + x
                    count += 1
        begin = last
    for index in range(number):
        v, u = candidates[index] // width, candidates[index] % width
        if foreground[v, u] == dark:
            foreground[v, u] = 255
