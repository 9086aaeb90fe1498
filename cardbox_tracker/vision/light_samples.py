"""Compiled kernels of the light: measured in every fourth pixel, limited in all pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.compiling import njit

# A channel above this may be saturated, so the pixel may be brighter than it seems.
CUT_OFF = 250.0


@njit(cache=True, nogil=True, error_model="numpy")
def collect_ratios(
    small: Any, mean: Any, brightest: Any, field: Any, person: Any, ratios: Any
) -> Any:
    """Write the ratios of measured to expected brightness in the background; return their count.

    Args:
        small: brightness of an image, (h, w) uint8.
        mean: brightness of the background.
        brightest: the brightest channel of the background; infinite where it must not be used.
        field: expected brightness of each pixel as a factor of the level.
        person: not 0 where the person is.
        ratios: result, at least h * w values.
    """
    count = 0
    height, width = small.shape
    for v in range(height):
        for u in range(width):
            ratio = np.float32(small[v, u]) / max(mean[v, u], np.float32(1))
            if person[v, u] == 0 and ratio * brightest[v, u] < CUT_OFF:
                ratios[count] = ratio / field[v, u]
                count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def sum_cells(
    seen: Any,
    around: Any,
    base: Any,
    person: Any,
    level: Any,
    tolerance: Any,
    cells: Any,
) -> None:
    """Write each cell's mean change times its share of usable pixels, and that share.

    Args:
        seen: ``small``, ``mean`` and ``brightest`` as for :func:`collect_ratios`.
        around: expected factors of the level, (h, w).
        base: factors of the level that the change is relative to, (h, w).
        person: not 0 where the person is.
        level: brightness of the scene relative to the learned background.
        tolerance: pixels that differ from ``around`` by more than this fraction are not used.
        cells: result, (2, rows, columns).
    """
    cells[:] = 0
    small, mean, brightest = seen
    height, width = small.shape
    rows, columns = cells.shape[1:]
    share = np.float32(rows * columns / (height * width))
    for v in range(height):
        for u in range(width):
            ratio = np.float32(small[v, u]) / max(mean[v, u], np.float32(1))
            relative = np.float32(ratio / level)
            change = relative / around[v, u] - 1
            # A saturated pixel gives only a lower bound.
            is_cut_off = ratio * brightest[v, u] >= CUT_OFF
            known = not is_cut_off or (change > 0 and np.isfinite(brightest[v, u]))
            if person[v, u] == 0 and known and abs(change) < tolerance:
                row, column = v * rows // height, u * columns // width
                cells[0, row, column] += share * (relative / base[v, u] - 1)
                cells[1, row, column] += share


@njit(cache=True, nogil=True, error_model="numpy")
def limit_channels(
    light: Any, mean: Any, channels: Any, brightest: Any, weights: Any, now: Any
) -> None:
    """Write the present brightness, with each channel limited to 255, to ``now``, (n,).

    Args:
        light: the background with the light's field, (n,), the level of the light, and the
            brightness above which a channel may be cut off.
        mean: learned background, (n,).
        channels: its channels, (k, n).
        brightest: its brightest channel, (n,).
        weights: of the channels in the brightness, (k,).
        now: result, (n,).
    """
    relative, level, limit = light
    one, most = np.float32(1), np.float32(255)
    for i in range(len(now)):
        value = relative[i] * level
        if brightest[i] > limit:
            factor = value / max(mean[i], one)
            value = np.float32(0)
            for k in range(len(weights)):
                value += weights[k] * min(channels[k, i] * factor, most)
        now[i] = value
