"""Compiled Gauss-Newton steps that draw the model's outline onto a silhouette's.

The outline of a state (14,) are points on the edges of its patches that no other patch covers.
Each has a distance from the outline of its camera's silhouette, r, px; with weights as of Geman and
McClure, and kept near the state to begin with by squares in units of ``stddev``, the steps lower

    INFORMATION * sum(length * r^2 / (1 + r^2 / HALF^2)) + sum(((state - begin) / stddev)^2)

Who changes ``whole_body_kernels.py`` or ``outline_points.py`` has to delete the cache of compiled
code of this file.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, PlaceTuple, ViewTuple
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.outline_distances import HALF_PX
from cardbox_tracker.estimation.cost.outline_points import (
    Ints,
    distance_at,
    find_outline,
    first_points,
    moved_patches,
    point_on_edge,
    project_corners,
)
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    BODY_PATCHES,
    N_STATE,
    TRUNK_PATCHES,
    new_figure,
    place_patches,
)

_compile = njit(cache=True, nogil=True, error_model="numpy")

SHARES = (0.0, 0.2, 0.5, 1.0)
"""What of a change is tried."""

# What a pixel of outline says, in 1 / px^2: 312 neighbouring points do not err on their own.
INFORMATION = 0.01
_MOST_CHANGE = 0.25


@_compile
def _seen_from(state: Floats, turned: Floats, moved: Floats, there: Floats) -> None:
    """Write the state (14,) as another camera has it."""
    for j in range(N_STATE):
        total = 0.0
        for i in range(N_STATE):
            total += state[i] * turned[i, j]
        there[j] = total + moved[j]


@_compile
def add_equations(
    state: Floats,
    turned: Floats,
    moved: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    lens: Floats,
    field: NDArray[np.float32],
    end_row: float,
    steps: Floats,
    matrix: Floats,
    right: Floats,
    edges: Ints,
    points: Floats,
) -> int:
    """Add to the normal equations of ``state`` (14,) what one camera's outline says.

    Args:
        state: of the first camera.
        turned: ``state`` times this, (14, 14), plus
        moved: this, (14,), is the state as this camera has it.
        parts: as of :func:`~.whole_body_kernels.corners_of_body`, like the next four.
        drawn: see there.
        girdle: see there.
        place: see there.
        view: see there.
        lens: fx, fy, cx, cy of the image of ``field``, (4,).
        field: signed distances from the silhouette's outline, (H, W), px, negative inside.
        end_row: rows from it on do not count.
        steps: of the central differences, (14,).
        matrix: (14, 14), of which the lower triangle is used.
        right: (14,).
        edges: written: where the points of the outline are, (312, 2).
        points: written: how far along their edges, and how much outline each stands for, (312, 2).

    Returns:
        How many points there are.
    """
    figure = parts, drawn, girdle, place, view
    work, arm = new_figure()
    trial, there, behind = np.empty(N_STATE), np.empty(N_STATE), np.empty(N_STATE)
    corners_px, less_px = np.empty((BODY_PATCHES, 4, 2)), np.empty((BODY_PATCHES, 4, 2))
    _seen_from(state, turned, moved, there)
    place_patches(there, True, (True, True), *figure, work, arm)
    project_corners(work.corners, lens, 0, BODY_PATCHES, corners_px)
    count = find_outline(corners_px, (field.shape[1], field.shape[0]), end_row, edges, points)
    first_point = np.empty(BODY_PATCHES + 1, np.int64)
    first_points(edges, count, first_point)
    now, weights, by_state = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        now[i] = distance_at(
            field, *point_on_edge(corners_px, edges[i, 0], edges[i, 1], points[i, 0])
        )
        outlying = 1.0 + (now[i] / HALF_PX) ** 2
        weights[i] = INFORMATION * points[i, 1] / (outlying * outlying)
    # Of each value of a state only the points that move with it count.
    jacobian, span = np.empty((N_STATE, count)), np.empty((N_STATE, 2), np.int64)
    for j in range(N_STATE):
        trial[:] = state
        trial[j] = state[j] + steps[j]
        _seen_from(trial, turned, moved, there)
        trial[j] = state[j] - steps[j]
        _seen_from(trial, turned, moved, behind)
        first, end = moved_patches(there, behind)
        span[j, 0], span[j, 1] = first_point[first], first_point[end]
        has_arm = first <= TRUNK_PATCHES < end, end == BODY_PATCHES
        place_patches(there, first == 0, has_arm, *figure, work, arm)
        project_corners(work.corners, lens, first, end, corners_px)
        place_patches(behind, first == 0, has_arm, *figure, work, arm)
        project_corners(work.corners, lens, first, end, less_px)
        for i in range(span[j, 0], span[j, 1]):
            p, c, share = edges[i, 0], edges[i, 1], points[i, 0]
            more = distance_at(field, *point_on_edge(corners_px, p, c, share))
            less = distance_at(field, *point_on_edge(less_px, p, c, share))
            jacobian[j, i] = (more - less) / (2.0 * steps[j])
    for j in range(N_STATE):
        total = 0.0
        for i in range(span[j, 0], span[j, 1]):
            weighted = weights[i] * jacobian[j, i]
            total += weighted * now[i]
            by_state[i] = weighted
        right[j] += total
        for k in range(j + 1):
            total = 0.0
            for i in range(max(span[j, 0], span[k, 0]), min(span[j, 1], span[k, 1])):
                total += by_state[i] * jacobian[k, i]
            matrix[j, k] += total
    return count


@_compile
def costs_along(
    state: Floats,
    change: Floats,
    turned: Floats,
    moved: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    lens: Floats,
    field: NDArray[np.float32],
    edges: Ints,
    points: Floats,
    costs: Floats,
) -> None:
    """Add to ``costs``, of each of ``SHARES`` of a change, what one camera's outline costs.

    Args:
        state: of the first camera, (14,).
        change: of it, (14,).
        turned: as of :func:`add_equations`, like the rest.
        moved: see there.
        parts: see there.
        drawn: see there.
        girdle: see there.
        place: see there.
        view: see there.
        lens: see there.
        field: see there.
        edges: (n, 2), as written there.
        points: (n, 2), as written there.
        costs: one for each share.
    """
    work, arm = new_figure()
    trial, there = np.empty(N_STATE), np.empty(N_STATE)
    corners_px = np.empty((BODY_PATCHES, 4, 2))
    for number in range(len(SHARES)):
        for j in range(N_STATE):
            trial[j] = state[j] + SHARES[number] * change[j]
        _seen_from(trial, turned, moved, there)
        place_patches(there, True, (True, True), parts, drawn, girdle, place, view, work, arm)
        project_corners(work.corners, lens, 0, BODY_PATCHES, corners_px)
        for i in range(len(points)):
            x, y = point_on_edge(corners_px, edges[i, 0], edges[i, 1], points[i, 0])
            square = distance_at(field, x, y) ** 2
            costs[number] += INFORMATION * points[i, 1] * square / (1.0 + square / HALF_PX**2)


@_compile
def solve_equations(
    state: Floats, begin: Floats, stddev: Floats, matrix: Floats, right: Floats, costs: Floats
) -> None:
    """Write the change of ``state`` into ``right``, and what leaving ``begin`` costs.

    Args:
        state: (14,).
        begin: the state near which it is kept, in units of
        stddev: these, (14,).
        matrix: of the normal equations, (14, 14); overwritten.
        right: their right side; overwritten by the change, (14,).
        costs: written: of each of ``SHARES`` of the change.
    """
    for j in range(N_STATE):
        matrix[j, j] += 1.0 / stddev[j] ** 2
        right[j] = -right[j] - (state[j] - begin[j]) / stddev[j] ** 2
    solve(matrix, right)
    for j in range(N_STATE):
        right[j] = min(max(right[j], -_MOST_CHANGE), _MOST_CHANGE)
    for number in range(len(SHARES)):
        costs[number] = 0.0
        for j in range(N_STATE):
            trial = state[j] + SHARES[number] * right[j]
            costs[number] += ((trial - begin[j]) / stddev[j]) ** 2
