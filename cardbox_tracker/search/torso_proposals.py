"""Compiled proposals of torsos by random numbers, unit normal or uniform in 0..1."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    angles_of_arm,
    limb_directions,
    side_of,
    state_pose,
)
from cardbox_tracker.person.posture import (
    N_STATE,
    PITCH,
    TORSO_X,
    TORSO_Y,
    YAW,
)
from cardbox_tracker.search.joint_moves import (
    Noise,
    Numbers,
    clip_state,
    pivot,
)
from cardbox_tracker.search.state_choice import least_of
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

# Deviation of the yaw of the upright torsos that face the camera, rad.
_FRESH_YAW_RAD = 0.3


Upright = tuple[int, Floats, float, float, float]
"""Number of upright torsos at the place of the silhouette; state with hanging arms, (14,);
deviation of ``torso_x``, m; bearing of the silhouette, lateral coordinate over depth; distance of
the person in the body model, m."""


@inlined_kernel
def _turn_anywhere(state: Floats, angle: int, limits: Floats, value: float) -> None:
    """Set an angle of a state by a uniform random number."""
    state[angle] = limits[angle, 0] + (limits[angle, 1] - limits[angle, 0]) * value


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
    ``explorers`` bow or turn; the last of these stand upright. ``numbers`` are
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
            _turn_anywhere(state, PITCH if uniforms[i, 0] < 0.5 else YAW, limits, uniforms[i, 1])
        else:
            for d in range(N_STATE):
                state[d] = fresh_state[d]
            state[TORSO_X] += fresh_x_m * normals[i, TORSO_X]
            clip_state(state, limits)
            # People walk in sideways.
            if uniforms[i, 0] < 0.5:
                _turn_anywhere(state, YAW, limits, uniforms[i, 1])
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
