"""Compiled kernels that find foreground without an outline, which light has caused.

They work on every fourth pixel of every fourth row.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import inlined_allocation, kernel
from cardbox_tracker.segmentation.light_samples import take_samples

# Light varies by less than this fraction within 12 px; an outline does not.
_SOFT = 0.06
# Margin around the person, px of the samples.
_MARGIN = 2
_f32, _u32 = np.float32, np.uint32


@kernel
def average_blocks(quads: Any, means: Any) -> None:
    """Write the rounded means (h, w) float32 of blocks of 4x4 px.

    ``quads`` (4 h, w) uint32 are an image with four pixels of a row in a number.
    """
    low, eight = _u32(0x00FF00FF), _u32(8)
    ten, bits = _u32(16), _u32(0xFFFF)
    totals = np.empty(means.shape[1], np.uint32)
    for v in range(means.shape[0]):
        totals[:] = 0
        for k in range(4):
            row = quads[4 * v + k]
            for u in range(len(totals)):
                pairs = _u32(_u32(row[u] & low) + _u32(_u32(row[u] >> eight) & low))
                totals[u] = _u32(totals[u] + pairs)
        out = means[v]
        for u in range(len(totals)):
            total = _u32(_u32(totals[u] & bits) + _u32(totals[u] >> ten))
            out[u] = np.rint(_f32(total) * _f32(1 / 16))


@kernel
def find_smooth(
    means: Any, blocks: Any, fine: Any, level: Any, silhouette: Any, smooth: Any, lit: Any
) -> Any:
    """Find foreground into which the brightness passes smoothly from the background.

    ``means`` (h, w) are the brightness of an image, and become relative to the background's
    ``blocks`` (h, w); ``fine`` (h, w) are expected factors of the ``level``, the brightness of the
    scene relative to the learned one. The silhouette (H, W) has the resolution of the image.
    ``smooth`` (h, w) is written, as is ``lit``, its part that is brighter than the background,
    whose number of pixels is returned.
    """
    height, width = means.shape
    one, level = _f32(1), _f32(level)
    person = np.empty((height, width), np.uint8)
    take_samples(silhouette, person)
    for v in range(height):
        row, dark, factor = means[v], blocks[v], fine[v]
        for u in range(width):
            row[u] = row[u] / (dark[u] * factor[u] * level)
    # 0: an outline, or background that was reached; 1: foreground; 2: what the flood starts from.
    state = np.empty((height, width), np.uint8)
    low, high = np.empty(width + 2, np.float32), np.empty(width + 2, np.float32)
    for v in range(height):
        above, here, below = means[max(v - 1, 0)], means[v], means[min(v + 1, height - 1)]
        for u in range(width):
            low[u + 1] = min(min(above[u], here[u]), below[u])
            high[u + 1] = max(max(above[u], here[u]), below[u])
        low[0], low[width + 1] = low[1], low[width]
        high[0], high[width + 1] = high[1], high[width]
        out, hidden = state[v], person[v]
        for u in range(width):
            lowest = min(min(low[u], low[u + 1]), low[u + 2])
            varies = max(max(high[u], high[u + 1]), high[u + 2]) - lowest
            kind = np.uint8(1) if hidden[u] > 0 else np.uint8(2)
            out[u] = kind if varies < _f32(_SOFT) else np.uint8(0)
    _flood(state, smooth)
    count = 0
    for v in range(height):
        row, found, out = means[v], smooth[v], lit[v]
        for u in range(width):
            is_lit = found[u] & (row[u] > one)
            out[u] = is_lit
            count += is_lit
    return count


@inlined_allocation
def _flood(state: Any, reached: Any) -> None:
    """Mark the pixels of the state 1 that are connected to the state 2 by their sides."""
    height, width = state.shape
    queue = np.empty((2, height * width), np.int32)
    rows, columns = queue[0], queue[1]
    reached[:] = False
    count = 0
    for v in range(height):
        for u in range(width):
            if state[v, u] == 1 and (
                (v > 0 and state[v - 1, u] == 2)
                or (v + 1 < height and state[v + 1, u] == 2)
                or (u > 0 and state[v, u - 1] == 2)
                or (u + 1 < width and state[v, u + 1] == 2)
            ):
                reached[v, u] = True
                rows[count], columns[count] = v, u
                count += 1
    begin = 0
    while begin < count:
        v, u = rows[begin], columns[begin]
        begin += 1
        for k in range(4):
            y = v + (k == 0) - (k == 1)
            x = u + (k == 2) - (k == 3)
            if y < 0 or y >= height or x < 0 or x >= width:
                continue
            if state[y, x] == 1 and not reached[y, x]:
                reached[y, x] = True
                rows[count], columns[count] = y, x
                count += 1


@kernel
def grow_person(silhouette: Any, without: Any, grown: Any) -> None:
    """Write the samples of a silhouette with a margin, (h, w): 0, or the highest value nearby.

    The silhouette (H, W) has the resolution of the image; samples ``without`` (h, w) are no person.
    """
    height, width = grown.shape
    person = np.empty((height, width), np.uint8)
    take_samples(silhouette, person)
    for v in range(height):
        row, left_out = person[v], without[v]
        for u in range(width):
            row[u] = np.uint8(0) if left_out[u] else row[u]
    most = np.zeros(width + 2 * _MARGIN, np.uint8)
    for v in range(height):
        a, b, c = person[max(v - 2, 0)], person[max(v - 1, 0)], person[v]
        d, e = person[min(v + 1, height - 1)], person[min(v + 2, height - 1)]
        for u in range(width):
            most[u + 2] = max(max(max(a[u], b[u]), max(d[u], e[u])), c[u])
        out = grown[v]
        for u in range(width):
            pair, other = max(most[u], most[u + 1]), max(most[u + 3], most[u + 4])
            out[u] = max(max(pair, other), most[u + 2])
