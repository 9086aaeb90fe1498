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

from cardbox_tracker.body.kinematics import TWIST, state_twists
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.body_outline import (
    BODY_PATCHES,
    new_scratch,
    place_patches,
)
from cardbox_tracker.estimation.cost.kernel_arguments import BodyTuple, Floats, body_of
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.outline_distances import HALF_PX
from cardbox_tracker.estimation.cost.outline_motions import (
    SEGMENTS,
    add_moments,
    segment_of,
)
from cardbox_tracker.estimation.cost.outline_points import (
    Ints,
    distance_at,
    find_outline,
    point_on_edge,
    project_corners,
)

SHARES = (0.0, 0.2, 0.5, 1.0)
"""Step lengths of the line search, as fractions of a change."""

# Weight of a pixel of outline, 1 / px^2; it is low because errors of neighbours are correlated.
INFORMATION = 0.01
_MOST_CHANGE = 0.25
_PER_HALF = 1.0 / HALF_PX**2
# Half of the stretch over which the distance's gradient is taken; shorter ones suffer from pixels.
_APART_PX = 3.0


class Seen(NamedTuple):
    """One camera and its silhouette.

    The state in the frame of this camera is ``turned`` @ (state of the first camera) + ``moved``.

    Attributes:
        turned: (14, 14); combines only values that move the whole body.
        moved: (14,).
        lens: fx, fy, cx, cy of the image of ``field``, (4,).
        field: signed distances from the silhouette's outline, (H, W), px, negative inside.
        within: first and last column, first and end row of the part that counts, (4,), px.
    """

    turned: Floats
    moved: Floats
    lens: Floats
    field: NDArray[np.float32]
    within: Floats


class Outline(NamedTuple):
    """Points of an outline.

    Attributes:
        edges: patch, and corner at which the edge of the point begins, (n, 2).
        points: fraction of the edge, and length of the outline at the point, px, (n, 2).
    """

    edges: Ints
    points: Floats


SeenTuple = tuple[Floats, Floats, Floats, NDArray[np.float32], Floats]
OutlineTuple = tuple[Ints, Floats]
EquationsTuple = tuple[Floats, Floats, Floats]


@kernel
def _seen_from(state: Floats, turned: Floats, moved: Floats, there: Floats) -> None:
    """Write the state (14,) in the frame of another camera."""
    there[:] = moved
    for i in range(N_STATE):
        for j in range(N_STATE):
            there[j] += state[i] * turned[i, j]


@kernel
def add_equations(
    state: Floats,
    camera: SeenTuple,
    body: BodyTuple,
    equations: EquationsTuple,
    outline: OutlineTuple,
) -> int:
    """Add the outline in one camera to the normal equations of ``state`` (14,).

    With the gradient (a, b) of the distance, px / px, and the line of sight (u, v, 1) of a point at
    the depth z, force and torque of :mod:`.outline_motions` are

        f = (fx a, fy b, -fx a u - fy b v) / z,    X x f = (u, v, 1) x z f

    Args:
        state: state for the first camera, (14,).
        camera: fields of :class:`Seen`.
        body: fields of :class:`~.kernel_arguments.Body`, before this camera.
        equations: matrix (14, 14), lower triangle, right side (14,), and costs of ``SHARES``, of
            which only the first changes.
        outline: fields of :class:`Outline`, written, (312, 2) each.

    Returns:
        Number of points of the outline.
    """
    seen, of = Seen(*camera), body_of(body)
    turned, lens, field = seen.turned, seen.lens, seen.field
    matrix, right, cost = equations
    edges, points = outline
    work, arm = new_scratch()
    there, corners_px = np.empty(N_STATE), np.empty((BODY_PATCHES, 4, 3))
    _seen_from(state, turned, seen.moved, there)
    place_patches(there, of, work, arm)
    project_corners(work.corners, lens, corners_px)
    count = find_outline(corners_px, seen.within, edges, points)
    sums, moments = np.zeros((SEGMENTS, TWIST)), np.zeros((SEGMENTS, TWIST, TWIST))
    per_x, per_y = lens[0] / (2.0 * _APART_PX), lens[1] / (2.0 * _APART_PX)
    wide, high = 1.0 / lens[0], 1.0 / lens[1]
    slope = np.empty(TWIST)
    for i in range(count):
        p = edges[i, 0]
        x, y, inverse = point_on_edge(corners_px, p, edges[i, 1], points[i, 0])
        distance = distance_at(field, x, y)
        a = distance_at(field, x + _APART_PX, y) - distance_at(field, x - _APART_PX, y)
        b = distance_at(field, x, y + _APART_PX) - distance_at(field, x, y - _APART_PX)
        a, b = per_x * a, per_y * b
        u, v = (x - lens[2]) * wide, (y - lens[3]) * high
        c = -a * u - b * v
        slope[0], slope[1], slope[2] = a * inverse, b * inverse, c * inverse
        slope[3], slope[4], slope[5] = v * c - b, a - u * c, u * b - v * a
        outlying = 1.0 + distance**2 * _PER_HALF
        cost[0] += INFORMATION * points[i, 1] * distance**2 / outlying
        weight = INFORMATION * points[i, 1] / (outlying * outlying)
        segment = segment_of(p)
        for j in range(TWIST):
            weighted = weight * slope[j]
            sums[segment, j] += weighted * distance
            for k in range(TWIST):
                moments[segment, j, k] += weighted * slope[k]
    own, twists = np.empty((N_STATE, TWIST)), np.zeros((N_STATE, TWIST))
    state_twists(there, of, own)
    for i in range(N_STATE):
        for j in range(N_STATE):
            if turned[i, j] != 0.0:
                for k in range(TWIST):
                    twists[i, k] += turned[i, j] * own[j, k]
    add_moments(twists, sums, moments, matrix, right)
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
    """Add the costs of one camera's outline after each of ``SHARES`` but the first to ``costs``.

    Args:
        state: state for the first camera, (14,).
        change: change of the state, (14,).
        camera: fields of :class:`Seen`.
        body: fields of :class:`~.kernel_arguments.Body`, before this camera.
        outline: fields of :class:`Outline`, from :func:`add_equations`.
        costs: one for each of ``SHARES``; changed.
    """
    seen, of = Seen(*camera), body_of(body)
    field, (edges, points) = seen.field, outline
    work, arm = new_scratch()
    trial, there = np.empty(N_STATE), np.empty(N_STATE)
    corners_px = np.empty((BODY_PATCHES, 4, 3))
    for number in range(1, len(SHARES)):
        for j in range(N_STATE):
            trial[j] = state[j] + SHARES[number] * change[j]
        _seen_from(trial, seen.turned, seen.moved, there)
        place_patches(there, of, work, arm)
        project_corners(work.corners, seen.lens, corners_px)
        total = 0.0
        for i in range(len(points)):
            x, y, _ = point_on_edge(corners_px, edges[i, 0], edges[i, 1], points[i, 0])
            square = distance_at(field, x, y) ** 2
            total += points[i, 1] * square / (1.0 + square * _PER_HALF)
        costs[number] += INFORMATION * total


@kernel
def solve_equations(
    state: Floats, begin: Floats, stddev: Floats, matrix: Floats, right: Floats, costs: Floats
) -> None:
    """Write the change of ``state`` to ``right``, and add the costs of the distance to ``begin``.

    Args:
        state: (14,).
        begin: mean of the quadratic prior, (14,).
        stddev: standard deviations of the prior, (14,).
        matrix: matrix of the normal equations, (14, 14); overwritten.
        right: right side, (14,); overwritten by the change.
        costs: one for each of ``SHARES`` of the change; changed.
    """
    for j in range(N_STATE):
        matrix[j, j] += 1.0 / stddev[j] ** 2
        right[j] = -right[j] - (state[j] - begin[j]) / stddev[j] ** 2
    solve(matrix, right)
    for j in range(N_STATE):
        right[j] = min(max(right[j], -_MOST_CHANGE), _MOST_CHANGE)
    for number in range(len(SHARES)):
        for j in range(N_STATE):
            trial = state[j] + SHARES[number] * right[j]
            costs[number] += ((trial - begin[j]) / stddev[j]) ** 2


@kernel
def step(state: Floats, change: Floats, costs: Floats) -> None:
    """Add the share of ``change`` (14,) with the least of ``costs``, one for each of ``SHARES``."""
    best = 0
    for number in range(1, len(SHARES)):
        if costs[number] < costs[best]:
            best = number
    for j in range(N_STATE):
        state[j] += SHARES[best] * change[j]


@kernel
def smoothed(
    state: Floats, fitted: Floats, correction: Floats, kept: float, low: Floats, high: Floats
) -> Floats:
    """Return ``state`` (14,) with the smoothed correction, within the limits ``low``, ``high``.

    ``correction`` (14,) becomes ``kept`` of itself, and ``fitted`` - ``state`` for the rest.
    """
    moved = np.empty(N_STATE)
    for j in range(N_STATE):
        correction[j] = kept * correction[j] + (1.0 - kept) * (fitted[j] - state[j])
        value = state[j] + correction[j]
        # A value that is not a number stays one.
        if value < low[j]:
            value = low[j]
        elif value > high[j]:
            value = high[j]
        moved[j] = value
    return moved
