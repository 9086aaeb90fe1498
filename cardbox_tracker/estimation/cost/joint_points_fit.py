"""Compiled Gauss-Newton fits of states to the points of a detector, in one camera or several."""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.kinematics import Place, PosedArm, new_arm
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.compiling import inlined_kernel, kernel
from cardbox_tracker.estimation.cost.joint_points_kernels import (
    MOST,
    N_BONES,
    N_POINTS,
    Evidence,
    bone_residual,
    place_body,
    residual,
)
from cardbox_tracker.estimation.cost.kernel_arguments import (
    Body,
    BodyTuple,
    Floats,
    Intrinsics,
    body_of,
)
from cardbox_tracker.estimation.cost.linear_kernels import solve

_N_RESIDUALS = 2 * N_POINTS + N_BONES
# A point that is too far away to count in the cost still pulls.
_MOST = 4.0 * MOST
# Step of the differences, rad and m; the projection is smooth.
_STEP = 1e-4


class Fitted(NamedTuple):
    """Evidence and pose of C cameras for a fit; the first index of each array is the camera.

    Attributes:
        points: (C, 10, 3), as in :class:`Evidence`.
        deviations: (C, 10, 2).
        bones: (C, 5, 3).
        away: (C, 3).
        turned: transform of states of the first camera, (C, 14, 14).
        moved: offset of this transform, (C, 14).
        lenses: fields of :class:`~.kernel_arguments.Place` and
            :class:`~.kernel_arguments.Intrinsics`, (C, 8).
    """

    points: Floats
    deviations: Floats
    bones: Floats
    away: Floats
    turned: Floats
    moved: Floats
    lenses: Floats


FittedTuple = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]


@inlined_kernel
def _residuals(
    state: Floats,
    of: Body,
    seen: Evidence,
    scratch: tuple[Floats, Floats],
    posed: PosedArm,
    points: Floats,
    residuals: Floats,
) -> None:
    """Write all residuals (25,) of a state (14,); unknown ones are 0."""
    place_body(state, state, of, scratch, posed, points)
    for i in range(N_POINTS):
        residuals[2 * i], residuals[2 * i + 1] = 0.0, 0.0
        if seen.points[i, 2] > 0.0:
            residuals[2 * i], residuals[2 * i + 1] = residual(i, points, of.camera, seen)
    for bone in range(N_BONES):
        is_known = seen.bones[bone, 1] > 0.0
        residuals[2 * N_POINTS + bone] = bone_residual(bone, points, seen) if is_known else 0.0


@inlined_kernel
def _there(state: Floats, turned: Floats, moved: Floats, there: Floats) -> None:
    """Write a state (14,) of the first camera in the frame of another one."""
    for j in range(N_STATE):
        there[j] = moved[j]
        for k in range(N_STATE):
            there[j] += state[k] * turned[k, j]


@kernel
def fit_states(
    states: Floats,
    body: BodyTuple,
    fitted: FittedTuple,
    prior: tuple[Floats, Floats],
    damping: Floats,
    limits: Floats,
    count: int,
) -> None:
    """Move states (N, 14) of the first camera in place, by ``count`` damped Gauss-Newton steps.

    Args:
        states: initial states.
        body: fields of :class:`~.kernel_arguments.Body`; each camera has its own place and lens.
        fitted: fields of :class:`Fitted`.
        prior: mean and inverse variance of each value, (14,) each.
        damping: inverse variance of a step, (14,).
        limits: lowest and highest value of each, (14, 2).
        count: number of steps.
    """
    of, seen = body_of(body), Fitted(*fitted)
    mean, inverse = prior
    scratch, posed, points = (np.empty((3, 3)), np.empty(3)), new_arm(), np.empty((N_POINTS, 3))
    there, trial = np.empty(N_STATE), np.empty(N_STATE)
    now, above = np.empty(_N_RESIDUALS), np.empty(_N_RESIDUALS)
    jacobian, weights = np.empty((N_STATE, _N_RESIDUALS)), np.empty(_N_RESIDUALS)
    matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
    for n in range(states.shape[0]):
        state = states[n]
        for _ in range(count):
            matrix[:], change[:] = 0.0, 0.0
            for j in range(N_STATE):
                matrix[j, j] = inverse[j] + damping[j]
                change[j] = inverse[j] * (mean[j] - state[j])
            for camera in range(seen.lenses.shape[0]):
                lens = seen.lenses[camera]
                moved = Body(
                    of.parts,
                    of.drawn,
                    of.girdle,
                    Place(lens[0], lens[1]),
                    Intrinsics(lens[2], lens[3], lens[4], lens[5], lens[6], lens[7]),
                )
                one = Evidence(
                    seen.points[camera],
                    seen.deviations[camera],
                    seen.bones[camera],
                    seen.away[camera],
                )
                turned, offset = seen.turned[camera], seen.moved[camera]
                _there(state, turned, offset, there)
                _residuals(there, moved, one, scratch, posed, points, now)
                trial[:] = state
                for j in range(N_STATE):
                    trial[j] = state[j] + _STEP
                    _there(trial, turned, offset, there)
                    _residuals(there, moved, one, scratch, posed, points, above)
                    trial[j] = state[j]
                    for i in range(_N_RESIDUALS):
                        jacobian[j, i] = (above[i] - now[i]) / _STEP
                for i in range(N_POINTS):
                    square = now[2 * i] ** 2 + now[2 * i + 1] ** 2
                    weight = one.points[i, 2] * exp(-square / _MOST)
                    weights[2 * i], weights[2 * i + 1] = weight, weight
                for bone in range(N_BONES):
                    i = 2 * N_POINTS + bone
                    weights[i] = one.bones[bone, 1] * exp(-(now[i] ** 2) / _MOST)
                for j in range(N_STATE):
                    for i in range(_N_RESIDUALS):
                        weighted = weights[i] * jacobian[j, i]
                        change[j] -= weighted * now[i]
                        for k in range(j + 1):
                            matrix[j, k] += weighted * jacobian[k, i]
            solve(matrix, change)
            for j in range(N_STATE):
                state[j] = min(max(state[j] + change[j], limits[j, 0]), limits[j, 1])
