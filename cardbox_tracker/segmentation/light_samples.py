"""Compiled kernels of the light: measured in every fourth pixel, limited in all pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.segmentation.medians import LARGEST_BITS, count_up_to, element

CUT_OFF = 250.0
"""A channel above this may be saturated, so the pixel may be brighter than it seems."""
STEP_PX = 4
"""The light is estimated from every fourth pixel of every fourth row."""
BLOCK = 64
"""Number of pixels that are limited together."""

# The level is searched within this fraction of the last one first.
_NEAR = 0.002
_f32, _i32 = np.float32, np.int32


@kernel
def take_samples(image: Any, samples: Any) -> None:
    """Write every fourth pixel of every fourth row of an image to ``samples``, (h, w)."""
    for v in range(samples.shape[0]):
        row, out = image[1 + STEP_PX * v], samples[v]
        for u in range(len(out)):
            out[u] = row[1 + STEP_PX * u]


@kernel
def measure_level(
    image: Any,
    samples: Any,
    mean: Any,
    brightest: Any,
    field: Any,
    person: Any,
    ratios: Any,
    bits: Any,
    last: Any,
    share: Any,
) -> Any:
    """Return the median relative brightness outside the person; -1 without usable pixels.

    With too few usable pixels outside the person, less than ``share``, those of the person are
    used, too. Arrays of samples are (h, w), with n elements: ``samples`` of the image (H, W),
    written; ``mean`` and ``brightest`` channel of the background, infinite where it must not be
    used; ``field``, their expected brightness as factors of the level; ``person``, not 0 where one
    is. ``ratios`` (n + 2,) and ``bits``, the same memory, are scratch. Near the level ``last`` the
    median is found sooner.
    """
    take_samples(image, samples)
    n, last = samples.size, _f32(last)
    count = _collect(samples, mean, brightest, field, person, ratios)
    if count < share * n:
        nobody = np.zeros(samples.shape, np.uint8)
        count = _collect(samples, mean, brightest, field, nobody, ratios)
    # Two spare elements turn the limits into bits, and the result into a number.
    ratios[n], ratios[n + 1] = last * _f32(1 - _NEAR), last * _f32(1 + _NEAR)
    rank, low, high = count // 2, bits[n], bits[n + 1]
    if count_up_to(bits[:n], low) > rank:
        low = _i32(-1)
    if count_up_to(bits[:n], high) <= rank:
        high = LARGEST_BITS
    bits[n] = element(bits[:n], rank, low, high)
    return ratios[n] if count > 0 else _f32(-1)


@inlined_kernel
def _collect(samples: Any, mean: Any, brightest: Any, field: Any, person: Any, ratios: Any) -> Any:
    """Write the relative brightness of usable pixels, else infinity; return their number."""
    count, one, infinite = _i32(0), _f32(1), _f32(np.inf)
    height, width = samples.shape
    for v in range(height):
        now, before, most, light = samples[v], mean[v], brightest[v], field[v]
        hidden, out = person[v], ratios[width * v : width * (v + 1)]
        for u in range(width):
            ratio = _f32(now[u]) / max(before[u], one)
            is_known = (hidden[u] == 0) & (ratio * most[u] < _f32(CUT_OFF))
            out[u] = ratio / light[u] if is_known else infinite
            count += _i32(is_known)
    return count


@kernel
def sum_cells(
    small: Any,
    mean: Any,
    brightest: Any,
    around: Any,
    base: Any,
    person: Any,
    level: Any,
    tolerance: Any,
    cells: Any,
) -> None:
    """Write each cell's mean change times its share of usable pixels, and that share.

    ``small`` (h, w) is the brightness of an image, ``mean`` that of the background, ``brightest``
    its brightest channel, infinite where it must not be used. ``around`` (h, w) are expected
    factors of the ``level``, ``base`` those that the change is relative to. Pixels that differ from
    ``around`` by more than the fraction ``tolerance``, and those of the person, are not used.
    ``cells`` (rows, columns, 2) is written.
    """
    cells[:] = 0
    height, width = small.shape
    rows, columns = cells.shape[:2]
    one, zero, tolerance = _f32(1), _f32(0), _f32(tolerance)
    share = _f32(rows * columns / (height * width))
    level = _f32(level)
    changes, shares = np.empty(width, np.float64), np.empty(width, np.float32)
    places = np.empty(width, np.int64)
    for u in range(width):
        places[u] = u * columns // width
    for v in range(height):
        now, before, most = small[v], mean[v], brightest[v]
        near, known, hidden = around[v], base[v], person[v]
        for u in range(width):
            ratio = _f32(now[u]) / max(before[u], one)
            relative = ratio / level
            change = relative / near[u] - one
            # A saturated pixel gives only a lower bound.
            is_cut_off = ratio * most[u] >= _f32(CUT_OFF)
            is_known = ~is_cut_off | ((change > zero) & (most[u] < _f32(np.inf)))
            is_used = (hidden[u] == 0) & is_known & (abs(change) < tolerance)
            changes[u] = share * (np.float64(relative / known[u]) - 1.0) if is_used else 0.0
            shares[u] = share if is_used else zero
        sums = cells[v * rows // height]
        for u in range(width):
            sums[places[u], 0] += changes[u]
            sums[places[u], 1] += shares[u]


@kernel
def limit_channels(
    relative: Any,
    level: Any,
    limit: Any,
    mean: Any,
    channels: Any,
    brightest: Any,
    blocks: Any,
    weights: Any,
    now: Any,
) -> None:
    """Write the present brightness, with each channel limited to 255, to ``now``, (n,).

    ``relative`` (n,) is the background with the light's field; ``mean`` (n,), ``channels`` (k, n)
    and ``brightest`` (n,) are of the learned one, of which ``blocks`` are the maxima of each 64
    pixels. Above the brightness ``limit`` a channel may be cut off; ``weights`` (k,) are those of
    the channels in the brightness.
    """
    one, most = _f32(1), _f32(255)
    factors, values = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    for block in range(len(blocks)):
        start, end = BLOCK * block, min(BLOCK * (block + 1), len(now))
        light, before, out = relative[start:end], mean[start:end], now[start:end]
        for i in range(len(out)):
            out[i] = light[i] * level
        if blocks[block] > limit:
            for i in range(len(out)):
                factors[i] = out[i] / max(before[i], one)
                values[i] = _f32(0)
            for k in range(len(weights)):
                channel, weight = channels[k, start:end], weights[k]
                for i in range(len(out)):
                    values[i] += weight * min(channel[i] * factors[i], most)
            highest = brightest[start:end]
            for i in range(len(out)):
                out[i] = values[i] if highest[i] > limit else out[i]
