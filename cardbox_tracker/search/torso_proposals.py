"""Compiled proposals of torsos by random numbers, unit normal or uniform in 0..1."""

from __future__ import annotations

from math import pi

import numpy as np

from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    angles_of_arm,
    limb_directions,
    side_of,
    state_pose,
)
from cardbox_tracker.person.posture import FIRST_ANGLES, N_STATE, PITCH, TORSO_X, TORSO_Y, YAW
from cardbox_tracker.search.joint_moves import Noise, Numbers, clip_state, pivot
from cardbox_tracker.search.state_choice import least_of
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

# Explorers: half of them bow within this range, two fifths get any yaw, the others mirror the yaw;
# the distance of all has this deviation, m.
_BOW_FROM_RAD, _BOW_RANGE_RAD = -5.0 * pi / 180.0, 60.0 * pi / 180.0
_BOWING, _BOWING_OR_TURNING = 0.5, 0.9
_EXPLORERS_X_M = 0.06
# Fraction of the upright torsos with any yaw, since people walk in sideways; deviation of the yaw
# of the others, which face the camera, rad.
_FRESH_TURNED, _FRESH_YAW_RAD = 0.5, 0.3


Upright = tuple[int, Floats, float, float, float]
"""Number of upright torsos at the place of the silhouette; state with hanging arms, (14,);
deviation of ``torso_x``, m; bearing of the silhouette, lateral coordinate over depth; distance of
the person in the body model, m."""


@kernel
def propose_torsos(
    survivors: Floats,
    noise: Noise,
    step_m: float,
    explorers: int,
    upright: Upright,
    numbers: Numbers,
) -> Floats:
    """Return states (N, 14) with new torsos around ``survivors`` (M, 14), whose arms they keep.

    Every second torso rotates about the shoulders. Half of either kind moves by ``step_m``, the
    lateral step of the silhouette, because a walking person moves further than the noise. The last
    ``explorers`` bow, turn or mirror their yaw; the last of these stand upright. ``numbers`` are
    (N, 14) and (N, 2).
    """
    sigma, limits, lever_m = noise
    fresh, fresh_state, fresh_x_m, sight, distance_m = upright
    normals, uniforms = numbers
    n = normals.shape[0]
    states = np.empty((n, N_STATE))
    for i in range(n):
        source, state = survivors[i % survivors.shape[0]], states[i]
        for d in range(N_STATE):
            state[d] = source[d] + sigma[d] * normals[i, d]
        if (i // 2) % 2 == 1:
            state[TORSO_Y] += step_m
        clip_state(state, limits)
        if i < n - explorers:
            if i % 2 == 1:
                pivot(state, source, lever_m)
        elif i < n - fresh:
            kind, value = uniforms[i, 0], uniforms[i, 1]
            if kind < _BOWING:
                state[PITCH] = _BOW_FROM_RAD + _BOW_RANGE_RAD * value
            elif kind < _BOWING_OR_TURNING:
                state[YAW] = limits[YAW, 0] + (limits[YAW, 1] - limits[YAW, 0]) * value
            else:
                state[YAW] = limits[YAW, 0] + limits[YAW, 1] - state[YAW]
            # The random numbers of the arms are not used otherwise.
            state[TORSO_X] += _EXPLORERS_X_M * normals[i, FIRST_ANGLES[0]]
        else:
            for d in range(N_STATE):
                state[d] = fresh_state[d]
            state[TORSO_X] += fresh_x_m * normals[i, TORSO_X]
            clip_state(state, limits)
            if uniforms[i, 0] < _FRESH_TURNED:
                state[YAW] = limits[YAW, 0] + (limits[YAW, 1] - limits[YAW, 0]) * uniforms[i, 1]
            else:
                state[YAW] = fresh_state[YAW] + _FRESH_YAW_RAD * normals[i, YAW]
            state[TORSO_Y] = sight * (distance_m - state[TORSO_X])
        clip_state(state, limits)
    return states


@kernel
def pool_of(
    survivors: Floats,
    torsos: Floats,
    ratings: Floats,
    count: int,
    arms_of: Floats,
    body: BodyTuple,
    arm_limits: Floats,
) -> Floats:
    """Return ``survivors`` (M, 14) and the best ``count`` of ``torsos`` twice, (M + 2 count, 14).

    The torsos come first with their own arms, and then with the arms of the state ``arms_of``
    (14,), which stay fixed in space.
    """
    m = survivors.shape[0]
    order = least_of(ratings, count)
    pool = np.empty((m + 2 * count, N_STATE))
    for i in range(m):
        for d in range(N_STATE):
            pool[i, d] = survivors[i, d]
    old, new, hip = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    directions, turned = np.empty(6), np.empty(6)
    of = body_of(body)
    state_pose(arms_of, of.place, of.camera, old, hip)
    for i in range(count):
        state = pool[m + count + i]
        for d in range(N_STATE):
            pool[m + i, d] = state[d] = torsos[order[i], d]
        state_pose(state, of.place, of.camera, new, hip)
        for arm in range(2):
            side = side_of(arm)
            limb_directions(angles_in(arms_of, arm), side, directions)
            for half in range(2):
                for a in range(3):
                    turned[3 * half + a] = 0.0
                    for b in range(3):
                        world = 0.0
                        for c in range(3):
                            world += old[b, c] * directions[3 * half + c]
                        turned[3 * half + a] += new[b, a] * world
            angles_of_arm(turned, side, arm_limits, angles_in(state, arm))
    return pool
