"""Compiled kernels of the coarse field of the light: updated by cells, enlarged to the image."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel

# Weight of the assumption of no change, as a share of a cell's pixels.
_DOUBT = 0.02
_f32 = np.float32


@kernel
def update_field(cells: Any, base: Any, rate: Any, field: Any) -> Any:
    """Move the field towards the base times the change, and return the field's extremes.

    Args:
        cells: smoothed change of each cell times its share of known pixels, and that share,
            (h, w, 2).
        base: factors that the change is relative to, (h, w).
        rate: share of the new estimate in the field.
        field: factors of the level, (h, w), which are changed.
    """
    height, width = field.shape
    least, most = _f32(np.inf), _f32(-np.inf)
    for v in range(height):
        for u in range(width):
            # Cells without known pixels do not change.
            change = cells[v, u, 0] / (cells[v, u, 1] + _f32(_DOUBT))
            goal = base[v, u] * (_f32(1) + change)
            value = field[v, u] + rate * (goal - field[v, u])
            field[v, u] = value
            least, most = min(least, value), max(most, value)
    return least, most


@kernel
def multiply_field(mean: Any, field: Any, result: Any) -> None:
    """Write the product of an image (H, W) and the field (h, w), interpolated between cells."""
    height, width = mean.shape
    rows, columns = field.shape
    # The field's rows at the image's width.
    wide = np.empty((rows, width), np.float32)
    for u in range(width):
        near, far, share = _neighbours(u, width, columns)
        for v in range(rows):
            wide[v, u] = field[v, near] + share * (field[v, far] - field[v, near])
    for v in range(height):
        near, far, share = _neighbours(v, height, rows)
        upper, lower, row, out = wide[near], wide[far], mean[v], result[v]
        for u in range(width):
            out[u] = row[u] * (upper[u] + share * (lower[u] - upper[u]))


@inlined_kernel
def _neighbours(index: Any, length: Any, cells: Any) -> Any:
    """Return the two cells around a pixel, and the share of the second one."""
    place = (index + 0.5) * cells / length - 0.5
    place = min(max(place, 0.0), cells - 1.0)
    near = int(place)
    return near, min(near + 1, cells - 1), _f32(place - near)
