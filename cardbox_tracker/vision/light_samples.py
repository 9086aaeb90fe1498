"""What the pixels of an image say about the light: compiled passes over every fourth of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.compiling import njit

# A channel as bright as this may be cut off: the pixel is as bright as it seems, or brighter.
CUT_OFF = 250.0


@njit(cache=True, nogil=True, error_model="numpy")
def collect_ratios(
    small: Any, mean: Any, brightest: Any, field: Any, person: Any, ratios: Any
) -> Any:
    """Write how bright the background's pixels are as a factor of expected; return how many.

    Args:
        small: brightness of an image, (h, w) uint8.
        mean: brightness of the background.
        brightest: its brightest channel; infinite where it is not to be used.
        field: what is expected of each pixel as a factor of the level.
        person: not 0 where the person is.
        ratios: result, h * w numbers at least.
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
    """Write the mean change of each cell times its share of usable pixels, and that share.

    Args:
        seen: ``small``, ``mean`` and ``brightest`` as for :func:`collect_ratios`.
        around: factors of the level that background lies around, (h, w).
        base: factors of the level that the change is relative to, (h, w).
        person: not 0 where the person is.
        level: brightness of the scene as a factor.
        tolerance: a pixel farther from ``around`` than this fraction is not used.
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
            # What is cut off says only that it is no darker than that.
            is_cut_off = ratio * brightest[v, u] >= CUT_OFF
            known = not is_cut_off or (change > 0 and np.isfinite(brightest[v, u]))
            if person[v, u] == 0 and known and abs(change) < tolerance:
                row, column = v * rows // height, u * columns // width
                cells[0, row, column] += share * (relative / base[v, u] - 1)
                cells[1, row, column] += share
