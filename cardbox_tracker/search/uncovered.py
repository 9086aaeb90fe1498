"""Foreground that trunk and other arm leave uncovered, towards which a hand may reach."""

from __future__ import annotations

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.terms.bit_planes import FOREGROUND, PIXELS, Planes, value_at

# Distance between the points of the grid that is searched, px.
_GRID_PX = 3


@inlined_kernel
def _is_inside(uncovered: Planes, row: int, column: int, step: int) -> bool:
    """Return whether a point of the grid counts, see :func:`farthest_uncovered`."""
    if value_at(uncovered, row, column) != -1:
        return False
    level = 0
    for beside in range(column - 2, column + 3):
        level += value_at(uncovered, row, beside)
    if level > -4:
        return False
    above, below = row - step, row + step
    return value_at(uncovered, above, column) == -1 or value_at(uncovered, below, column) == -1


@kernel
def farthest_uncovered(
    uncovered: Planes, size: tuple[int, int], u: float, v: float, reach_px: float
) -> tuple[int, float, float]:
    """Return how many uncovered points are near a pixel, and column and row of the farthest one.

    A point of the grid counts if it is foreground, the values 1 - 2 f of the five pixels around it
    in its row add up to at most -4, and the point above or below is foreground. ``uncovered`` are
    planes (2, words, rows or more) without the covered pixels, of which ``size`` count, rows and
    width; ``u``, ``v`` and the largest distance are px.
    """
    rows, width = size
    count, best = 0, -1.0
    tip_u, tip_v = 0.0, 0.0
    step = _GRID_PX
    left, right = max(int(u - reach_px), step), min(int(u + reach_px), width - step - 1)
    top, bottom = max(int(v - reach_px), step), min(int(v + reach_px), rows - step - 1)
    for row in range(top, bottom, step):
        for w in range(left // PIXELS, (right + PIXELS - 1) // PIXELS):
            # Most words have no uncovered foreground.
            if uncovered[FOREGROUND, w, row] == 0:
                continue
            begin = left + max(PIXELS * w - left + step - 1, 0) // step * step
            for column in range(begin, min(PIXELS * (w + 1), right), step):
                far = (column - u) ** 2 + (row - v) ** 2
                if far <= reach_px * reach_px and _is_inside(uncovered, row, column, step):
                    count += 1
                    if far > best:
                        best, tip_u, tip_v = far, float(column), float(row)
    return count, tip_u, tip_v
