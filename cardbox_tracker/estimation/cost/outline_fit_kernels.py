"""Compiled Gauss-Newton steps that draw the model's outline onto a silhouette's.

The outline of a state (14,) are points on the edges of its patches that no other patch covers.
Each has a distance from the silhouette's outline, r, px; with weights as of Geman and McClure, and
kept near the state to begin with by squares in units of ``stddev``, the steps lower

    INFORMATION * sum(length * r^2 / (1 + r^2 / HALF^2)) + sum(((state - begin) / stddev)^2)

Who changes ``whole_body_kernels.py`` has to delete the cache of compiled code of this file.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, PlaceTuple, ViewTuple
from cardbox_tracker.estimation.cost.outline_distances import FAR_PX, HALF_PX
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    BODY_PATCHES,
    N_STATE,
    corners_of_body,
)

_compile = njit(cache=True, nogil=True, error_model="numpy")

# Points on each edge of a patch.
_ON_EDGE = 6
_POINTS = BODY_PATCHES * 4 * _ON_EDGE
# What a pixel of outline says, in 1 / px^2: 312 neighbouring points do not err on their own.
INFORMATION = 0.01
# A point counts as covered so far inside another patch, and is no outline so near to the border.
_COVERED_PX, _BORDER_PX = 0.5, 3.0
_MOST_CHANGE = 0.25


@_compile
def _outline(corners_m: Floats, lens: Floats, corners_px: Floats, points: Floats) -> None:
    """Write corners (13, 4, 2) and points on the edges (n, 2), px; ``lens`` is fx, fy, cx, cy."""
    n = 0
    for p in range(BODY_PATCHES):
        for c in range(4):
            x, y, z = corners_m[p, c, 0], corners_m[p, c, 1], max(corners_m[p, c, 2], 0.05)
            corners_px[p, c, 0] = lens[0] * x / z + lens[2]
            corners_px[p, c, 1] = lens[1] * y / z + lens[3]
        for c in range(4):
            d = (c + 1) % 4
            for k in range(_ON_EDGE):
                share = (k + 0.5) / _ON_EDGE
                for i in range(2):
                    begin = corners_px[p, c, i]
                    points[n, i] = begin + share * (corners_px[p, d, i] - begin)
                n += 1


@_compile
def _turns(corners_px: Floats, turns: Floats) -> None:
    """Write whether the corners of each patch run one way round, 1, or the other, -1; (13,)."""
    for p in range(BODY_PATCHES):
        twice_area = 0.0
        for c in range(4):
            d = (c + 1) % 4
            twice_area += (
                corners_px[p, c, 0] * corners_px[p, d, 1]
                - corners_px[p, d, 0] * corners_px[p, c, 1]
            )
        turns[p] = 1.0 if twice_area > 0.0 else -1.0


@_compile
def _is_inside(corners_px: Floats, p: int, turn: float, x: float, y: float) -> bool:
    """Whether a point is well inside the convex patch ``p``, whose corners run by ``turn``."""
    for c in range(4):
        d = (c + 1) % 4
        along_x = corners_px[p, d, 0] - corners_px[p, c, 0]
        along_y = corners_px[p, d, 1] - corners_px[p, c, 1]
        length = hypot(along_x, along_y)
        if length < 1e-9:
            continue
        across = along_x * (y - corners_px[p, c, 1]) - along_y * (x - corners_px[p, c, 0])
        if turn * across < _COVERED_PX * length:
            return False
    return True


@_compile
def _lengths(
    corners_px: Floats, points: Floats, size: tuple[int, int], end_row: float, lengths: Floats
) -> None:
    """Write how much outline each point stands for, px: 0 of one that is not on it."""
    width, height = size
    end = min(end_row, height - _BORDER_PX)
    turns = np.empty(BODY_PATCHES)
    _turns(corners_px, turns)
    n = 0
    for p in range(BODY_PATCHES):
        for c in range(4):
            d = (c + 1) % 4
            length = hypot(
                corners_px[p, d, 0] - corners_px[p, c, 0], corners_px[p, d, 1] - corners_px[p, c, 1]
            )
            for _ in range(_ON_EDGE):
                x, y = points[n, 0], points[n, 1]
                counts = _BORDER_PX <= x <= width - 1 - _BORDER_PX and _BORDER_PX <= y < end
                if counts:
                    for other in range(BODY_PATCHES):
                        if other != p and _is_inside(corners_px, other, turns[other], x, y):
                            counts = False
                            break
                lengths[n] = length / _ON_EDGE if counts else 0.0
                n += 1


@_compile
def _distances(field: NDArray[np.float32], points: Floats, lengths: Floats, found: Floats) -> None:
    """Write the values of ``field`` (H, W) at points (n, 2) of the outline, linear between pixels.

    Points that stand for no length get 0.
    """
    height, width = field.shape
    for i in range(points.shape[0]):
        if lengths[i] == 0.0:
            found[i] = 0.0
            continue
        x = min(max(points[i, 0], 0.0), width - 1.001)
        y = min(max(points[i, 1], 0.0), height - 1.001)
        u, v = int(x), int(y)
        a, b = x - u, y - v
        upper = field[v, u] * (1.0 - a) + field[v, u + 1] * a
        lower = field[v + 1, u] * (1.0 - a) + field[v + 1, u + 1] * a
        found[i] = min(max(upper * (1.0 - b) + lower * b, -FAR_PX), FAR_PX)


@_compile
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve in place for a symmetric positive definite matrix, by Cholesky's decomposition."""
    n = right.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = sqrt(max(total, 1e-12)) if i == j else total / matrix[j, j]
    for i in range(n):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@_compile
def fit_outline(
    state: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    lens: Floats,
    field: NDArray[np.float32],
    end_row: float,
    stddev: Floats,
    steps: Floats,
    count: int,
) -> None:
    """Improve ``state`` (14,) in place by ``count`` steps.

    Args:
        state: to begin with.
        parts: as of :func:`~.whole_body_kernels.corners_of_body`, like the next four.
        drawn: see there.
        girdle: see there.
        place: see there.
        view: see there.
        lens: fx, fy, cx, cy of the image of ``field``, (4,).
        field: signed distances from the silhouette's outline, (H, W), px, negative inside.
        end_row: rows from it on do not count.
        stddev: how far the state may go, (14,).
        steps: of the central differences, (14,).
        count: how many steps.
    """
    begin, trial = state.copy(), state.copy()
    corners_m, corners_px = np.empty((BODY_PATCHES, 4, 3)), np.empty((BODY_PATCHES, 4, 2))
    points, lengths = np.empty((_POINTS, 2)), np.empty(_POINTS)
    now, other = np.empty(_POINTS), np.empty(_POINTS)
    jacobian = np.empty((N_STATE, _POINTS))
    matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
    size = (field.shape[1], field.shape[0])
    for _ in range(count):
        corners_of_body(state, parts, drawn, girdle, place, view, corners_m)
        _outline(corners_m, lens, corners_px, points)
        _lengths(corners_px, points, size, end_row, lengths)
        _distances(field, points, lengths, now)
        for j in range(N_STATE):
            trial[:] = state
            trial[j] = state[j] + steps[j]
            corners_of_body(trial, parts, drawn, girdle, place, view, corners_m)
            _outline(corners_m, lens, corners_px, points)
            _distances(field, points, lengths, jacobian[j])
            trial[j] = state[j] - steps[j]
            corners_of_body(trial, parts, drawn, girdle, place, view, corners_m)
            _outline(corners_m, lens, corners_px, points)
            _distances(field, points, lengths, other)
            for i in range(_POINTS):
                jacobian[j, i] = (jacobian[j, i] - other[i]) / (2.0 * steps[j])
        for i in range(_POINTS):
            outlying = 1.0 + (now[i] / HALF_PX) ** 2
            other[i] = INFORMATION * lengths[i] / (outlying * outlying)
        for j in range(N_STATE):
            for k in range(j + 1):
                total = 0.0
                for i in range(_POINTS):
                    total += other[i] * jacobian[j, i] * jacobian[k, i]
                matrix[j, k] = total
            total = 0.0
            for i in range(_POINTS):
                total += other[i] * jacobian[j, i] * now[i]
            matrix[j, j] += 1.0 / stddev[j] ** 2
            change[j] = -total - (state[j] - begin[j]) / stddev[j] ** 2
        _solve(matrix, change)
        best, best_share = np.inf, 0.0
        for share in (0.0, 0.2, 0.5, 1.0):
            value = 0.0
            for j in range(N_STATE):
                trial[j] = state[j] + share * min(max(change[j], -_MOST_CHANGE), _MOST_CHANGE)
                value += ((trial[j] - begin[j]) / stddev[j]) ** 2
            corners_of_body(trial, parts, drawn, girdle, place, view, corners_m)
            _outline(corners_m, lens, corners_px, points)
            _distances(field, points, lengths, other)
            for i in range(_POINTS):
                square = other[i] ** 2
                value += INFORMATION * lengths[i] * square / (1.0 + square / HALF_PX**2)
            if value < best:
                best, best_share = value, share
        for j in range(N_STATE):
            state[j] += best_share * min(max(change[j], -_MOST_CHANGE), _MOST_CHANGE)
