"""Compiled kernels of the comparison by colour: from the channels of an image to a mask.

Rows are processed in single precision, in loops without branches that become vector instructions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import inlined_allocation, inlined_kernel, kernel

NEUTRAL = 128.0
"""Cr and Cb of grey."""
DARKEST = 8.0
"""Dark pixels have hardly any colour, so ratios of the brightness are limited below this."""
REACH_PX = 3
"""Radius within which the highest difference is searched: half of a JPEG chroma block."""

_RATIOS = (0.2, 1.6)
# A channel above this may be saturated, which changes the colour.
_CUT_OFF = 245.0
_i32, _f32, _u16 = np.int32, np.float32, np.uint16


@kernel
def collect_shares(colors: Any, background: Any, step: Any, shares: Any) -> None:
    """Write what the white balance adds to Cr and Cb, as shares of the brightness, (2, n).

    ``colors`` are brightness, Cr and Cb, (3, h, w), smoothed by 3x3 px here; every ``step``-th
    pixel is used. ``background`` is as for :func:`rate_colors`.
    """
    ninth, half, neutral = _f32(1 / 9), _f32(4.5), _f32(NEUTRAL)
    height, width = colors.shape[1:]
    count = 0
    for v in range(step // 2, height, step):
        rows = _before(v, height), v, _after(v, height)
        for u in range(step // 2, width, step):
            columns = _before(u, width), u, _after(u, width)
            level = red = blue = 0
            for y in rows:
                for x in columns:
                    level += colors[0, y, x]
                    red += colors[1, y, x]
                    blue += colors[2, y, x]
            brightness = np.floor((_f32(level) + half) * ninth)
            ratio, least = brightness * background[0, v, u], max(brightness, _f32(DARKEST))
            red_part = np.floor((_f32(red) + half) * ninth) - neutral
            blue_part = np.floor((_f32(blue) + half) * ninth) - neutral
            shares[0, count] = (red_part - ratio * background[1, v, u]) / least
            shares[1, count] = (blue_part - ratio * background[2, v, u]) / least
            count += 1


@inlined_kernel
def _before(index: Any, length: Any) -> Any:
    """Return the index of the pixel before one; the image is mirrored at its first pixel."""
    return min(abs(index - 1), length - 1)


@inlined_kernel
def _after(index: Any, length: Any) -> Any:
    """Return the index of the pixel after one; the image is mirrored at its last pixel."""
    return index + 1 if index < length - 1 else max(length - 2, 0)


@inlined_kernel
def _rate(colors: Any, place: Any, background: Any, cast: Any, sums: Any, score: Any) -> None:
    """Write the distance of each pixel's chroma from the background's, in units of its limit.

    The arguments are those of :func:`rate_colors`; ``sums`` is scratch, (3, w + 2).
    """
    height, width = score.shape
    top, left = place
    ninth, half, neutral = _f32(1 / 9), _f32(4.5), _f32(NEUTRAL)
    lowest, highest, cut_off = _f32(_RATIOS[0]), _f32(_RATIOS[1]), _f32(_CUT_OFF)
    levels, reds, blues = sums[0], sums[1], sums[2]
    for v in range(height):
        above, below = _before(v, height), _after(v, height)
        for k in range(3):
            one = colors[k, top + above, left : left + width]
            two = colors[k, top + v, left : left + width]
            three = colors[k, top + below, left : left + width]
            total = sums[k]
            for u in range(width):
                total[u + 1] = _f32(_i32(_i32(one[u]) + _i32(two[u]) + _i32(three[u])))
            total[0] = total[min(2, width)]
            total[width + 1] = total[max(width - 1, 1)]
        inverse = background[0, top + v, left : left + width]
        mean_red = background[1, top + v, left : left + width]
        mean_blue = background[2, top + v, left : left + width]
        weight_red = background[3, top + v, left : left + width]
        weight_blue = background[4, top + v, left : left + width]
        brightest = background[5, top + v, left : left + width]
        out = score[v]
        for u in range(width):
            # The sums of nine pixels become rounded means.
            level = np.floor((levels[u] + levels[u + 1] + levels[u + 2] + half) * ninth)
            red = np.floor((reds[u] + reds[u + 1] + reds[u + 2] + half) * ninth) - neutral
            blue = np.floor((blues[u] + blues[u + 1] + blues[u + 2] + half) * ninth) - neutral
            ratio = min(max(level * inverse[u], lowest), highest)
            red = (red - ratio * mean_red[u] - cast[0] * level) * weight_red[u]
            blue = (blue - ratio * mean_blue[u] - cast[1] * level) * weight_blue[u]
            distance = np.sqrt(red * red + blue * blue)
            out[u] = distance if ratio * brightest[u] < cut_off else _f32(0)


@inlined_kernel
def _subtract_edge(score: Any, edge: Any, row: Any, margin: Any) -> None:
    """Write the score less 1, or less the fraction ``edge`` of the highest nearby if that is more.

    ``row`` is scratch, (w + 6,).
    """
    height, width = score.shape
    row[:] = _f32(0)
    last = height - 1
    for v in range(height):
        a, b, c = score[max(v - 3, 0)], score[max(v - 2, 0)], score[max(v - 1, 0)]
        here = score[v]
        d, e, f = score[min(v + 1, last)], score[min(v + 2, last)], score[min(v + 3, last)]
        for u in range(width):
            most = max(max(max(a[u], b[u]), max(c[u], here[u])), max(max(d[u], e[u]), f[u]))
            row[u + 3] = most
        out = margin[v]
        for u in range(width):
            most = max(max(row[u], row[u + 1]), max(row[u + 2], row[u + 3]))
            most = max(most, max(max(row[u + 4], row[u + 5]), row[u + 6]))
            out[u] = min(here[u] - _f32(1), here[u] - edge * most)


@kernel
def rate_colors(
    colors: Any,
    top: Any,
    left: Any,
    height: Any,
    width: Any,
    background: Any,
    red_cast: Any,
    blue_cast: Any,
    edge: Any,
    score: Any,
    margin: Any,
) -> None:
    """Write the margin of each pixel of a window, which is at least 0 in the foreground.

    ``colors`` are brightness, Cr and Cb at half the resolution, (3, H, W) uint8; in the window,
    they are smoothed by 3x3 px. ``background`` are planes of the model, (6, H, W): what one grey
    level is of the brightness, Cr and Cb less that of grey, what one level of each is of its limit,
    the brightest channel. The casts are the Cr and Cb that the white balance adds, as shares of the
    brightness; ``edge`` is the fraction of the highest score nearby at which the outline is put.
    ``score`` is scratch, one for each pixel of a window of any size; ``margin``, of its size, has
    the result (h, w) in its first elements.
    """
    scores, margins = _part(score, height, width), _part(margin, height, width)
    rows = np.empty((3, width + 2 * REACH_PX), np.float32)
    _rate(colors, (top, left), background, (_f32(red_cast), _f32(blue_cast)), rows, scores)
    _subtract_edge(scores, _f32(edge), rows[0], margins)


@inlined_allocation
def _part(memory: Any, height: Any, width: Any) -> Any:
    """Return the first elements of flat memory as an array (height, width)."""
    return memory[: height * width].reshape((height, width))


@inlined_kernel
def _enlarge(margin: Any, row: Any, mask: Any) -> None:
    """Write where the margin (h, w) is at least 0 at twice the resolution; ``row`` is scratch."""
    height, width = margin.shape
    near, far, zero = _f32(0.75), _f32(0.25), _f32(0)
    first, second = _u16(0x00FF), _u16(0xFF00)
    for v in range(height):
        here = margin[v]
        for k in range(2):
            other = margin[max(v - 1, 0) if k == 0 else min(v + 1, height - 1)]
            for u in range(width):
                row[u + 1] = other[u] * far + here[u] * near
            row[0], row[width + 1] = row[1], row[width]
            out = mask[2 * v + k]
            for u in range(width):
                middle = row[u + 1] * near
                left = first if row[u] * far + middle >= zero else _u16(0)
                right = second if middle + row[u + 2] * far >= zero else _u16(0)
                out[u] = _u16(left | right)


@kernel
def find_colors(
    colors: Any,
    top: Any,
    left: Any,
    height: Any,
    width: Any,
    background: Any,
    red_cast: Any,
    blue_cast: Any,
    edge: Any,
    score: Any,
    margin: Any,
    mask: Any,
) -> None:
    """Write 255 where the margin is at least 0 at twice the resolution, else 0.

    ``mask`` has the result, (2 h, 2 w) uint8, in its first elements. The other arguments are those
    of :func:`rate_colors`.
    """
    rate_colors(
        colors, top, left, height, width, background, red_cast, blue_cast, edge, score, margin
    )
    pairs = _part(mask.view(np.uint16), 2 * height, width)
    _enlarge(_part(margin, height, width), np.empty(width + 2, np.float32), pairs)
