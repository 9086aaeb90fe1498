"""Compiled Gauss-Newton steps that fit the model's outline to the outline of a silhouette.

The outline of a state (14,) consists of points on the edges of its patches that no other patch
covers. Each point has a distance r, px, from the outline of its camera's silhouette. With
Geman-McClure weights and a quadratic prior around the initial state, the steps minimize

    INFORMATION * sum(length * r^2 / (1 + r^2 / HALF^2)) + sum(((state - begin) / stddev)^2)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.body_outline import (
    BODY_PATCHES,
    TRUNK_PATCHES,
    new_scratch,
    place_patches,
)
from cardbox_tracker.estimation.cost.kernel_arguments import BodyTuple, Floats, body_of
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

SHARES = (0.0, 0.2, 0.5, 1.0)
"""Step lengths of the line search, as fractions of a change."""

# Weight of a pixel of outline, 1 / px^2; it is low because errors of neighbours are correlated.
INFORMATION = 0.01
_MOST_CHANGE = 0.25
_ALL = (True, True, True)


class Seen(NamedTuple):
    """One camera and its silhouette.

    The state in the frame of this camera is ``turned`` @ (state of the first camera) + ``moved``.

    Attributes:
        turned: (14, 14).
        moved: (14,).
        lens: fx, fy, cx, cy of the image of ``field``, (4,).
        field: signed distances from the silhouette's outline, (H, W), px, negative inside.
        end_row: first row that does not count.
    """

    turned: Floats
    moved: Floats
    lens: Floats
    field: NDArray[np.float32]
    end_row: float


class Outline(NamedTuple):
    """Points of an outline.

    Attributes:
        edges: patch, and corner at which the edge of the point begins, (n, 2).
        points: fraction of the edge, and length of the outline at the point, px, (n, 2).
    """

    edges: Ints
    points: Floats


SeenTuple = tuple[Floats, Floats, Floats, NDArray[np.float32], float]
OutlineTuple = tuple[Ints, Floats]
EquationsTuple = tuple[Floats, Floats]


@kernel
def _seen_from(state: Floats, turned: Floats, moved: Floats, there: Floats) -> None:
    """Write the state (14,) in the frame of another camera."""
    for j in range(N_STATE):
        total = 0.0
        for i in range(N_STATE):
            total += state[i] * turned[i, j]
        there[j] = total + moved[j]


@kernel
def add_equations(
    state: Floats,
    camera: SeenTuple,
    body: BodyTuple,
    steps: Floats,
    equations: EquationsTuple,
    outline: OutlineTuple,
) -> int:
    """Add the outline in one camera to the normal equations of ``state`` (14,).

    Args:
        state: state for the first camera, (14,).
        camera: fields of :class:`Seen`.
        body: fields of :class:`~.kernel_arguments.Body`, before this camera.
        steps: steps of the central differences, (14,).
        equations: matrix (14, 14), lower triangle, and right side (14,); changed.
        outline: fields of :class:`Outline`, written, (312, 2) each.

    Returns:
        Number of points of the outline.
    """
    seen, of = Seen(*camera), body_of(body)
    turned, moved, lens, field = seen.turned, seen.moved, seen.lens, seen.field
    matrix, right = equations
    edges, points = outline
    work, arm = new_scratch()
    trial, there, behind = np.empty(N_STATE), np.empty(N_STATE), np.empty(N_STATE)
    corners_px, less_px = np.empty((BODY_PATCHES, 4, 2)), np.empty((BODY_PATCHES, 4, 2))
    _seen_from(state, turned, moved, there)
    place_patches(there, _ALL, of, work, arm)
    project_corners(work.corners, lens, 0, BODY_PATCHES, corners_px)
    count = find_outline(corners_px, (field.shape[1], field.shape[0]), seen.end_row, edges, points)
    first_point = np.empty(BODY_PATCHES + 1, np.int64)
    first_points(edges, count, first_point)
    now, weights, by_state = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        now[i] = distance_at(
            field, *point_on_edge(corners_px, edges[i, 0], edges[i, 1], points[i, 0])
        )
        outlying = 1.0 + (now[i] / HALF_PX) ** 2
        weights[i] = INFORMATION * points[i, 1] / (outlying * outlying)
    # Each value of a state moves only some of the points.
    jacobian, span = np.empty((N_STATE, count)), np.empty((N_STATE, 2), np.int64)
    for j in range(N_STATE):
        trial[:] = state
        trial[j] = state[j] + steps[j]
        _seen_from(trial, turned, moved, there)
        trial[j] = state[j] - steps[j]
        _seen_from(trial, turned, moved, behind)
        first, end = moved_patches(there, behind)
        span[j, 0], span[j, 1] = first_point[first], first_point[end]
        drawn = first == 0, first <= TRUNK_PATCHES < end, end == BODY_PATCHES
        place_patches(there, drawn, of, work, arm)
        project_corners(work.corners, lens, first, end, corners_px)
        place_patches(behind, drawn, of, work, arm)
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


@kernel
def costs_along(
    state: Floats,
    change: Floats,
    camera: SeenTuple,
    body: BodyTuple,
    outline: OutlineTuple,
    costs: Floats,
) -> None:
    """Add the costs of one camera's outline after each of ``SHARES`` of a change to ``costs``.

    Args:
        state: state for the first camera, (14,).
        change: change of the state, (14,).
        camera: fields of :class:`Seen`.
        body: fields of :class:`~.kernel_arguments.Body`, before this camera.
        outline: fields of :class:`Outline`, from :func:`add_equations`.
        costs: one for each of ``SHARES``; changed.
    """
    seen, of = Seen(*camera), body_of(body)
    edges, points = outline
    work, arm = new_scratch()
    trial, there = np.empty(N_STATE), np.empty(N_STATE)
    corners_px = np.empty((BODY_PATCHES, 4, 2))
    for number in range(len(SHARES)):
        for j in range(N_STATE):
            trial[j] = state[j] + SHARES[number] * change[j]
        _seen_from(trial, seen.turned, seen.moved, there)
        place_patches(there, _ALL, of, work, arm)
        project_corners(work.corners, seen.lens, 0, BODY_PATCHES, corners_px)
        for i in range(len(points)):
            x, y = point_on_edge(corners_px, edges[i, 0], edges[i, 1], points[i, 0])
            square = distance_at(seen.field, x, y) ** 2
            costs[number] += INFORMATION * points[i, 1] * square / (1.0 + square / HALF_PX**2)


@kernel
def solve_equations(
    state: Floats, begin: Floats, stddev: Floats, matrix: Floats, right: Floats, costs: Floats
) -> None:
    """Write the change of ``state`` to ``right``, and the costs of the distance to ``begin``.

    Args:
        state: (14,).
        begin: mean of the quadratic prior, (14,).
        stddev: standard deviations of the prior, (14,).
        matrix: matrix of the normal equations, (14, 14); overwritten.
        right: right side, (14,); overwritten by the change.
        costs: written, one for each of ``SHARES`` of the change.
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
