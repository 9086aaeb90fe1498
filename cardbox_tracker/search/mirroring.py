"""Compiled states that look alike in the image: mirror images of arms in depth, turned people."""

from __future__ import annotations

from math import sqrt

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    angles_of_arm,
    limb_directions,
    pose_arm,
    side_of,
    state_pose,
)
from cardbox_tracker.person.posture import PITCH, ROLL, YAW
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of


@inlined_kernel
def mirror(
    angles: Floats,
    side: float,
    flips: int,
    ray: Floats,
    arm_limits: Floats,
    directions: Floats,
) -> None:
    """Mirror upper arm (bit 0 of ``flips``) and forearm (bit 1) of an arm (4,) along ``ray`` (3,).

    ``ray`` is the line of sight in the torso's frame, a unit vector. The outline hardly changes.
    """
    limb_directions(angles, side, directions)
    for half in range(2):
        if (flips >> half) & 1:
            o = 3 * half
            along = directions[o] * ray[0] + directions[o + 1] * ray[1] + directions[o + 2] * ray[2]
            for c in range(3):
                directions[o + c] -= 2.0 * along * ray[c]
    angles_of_arm(directions, side, arm_limits, angles)


@kernel
def mirrored_states(state: Floats, body: BodyTuple, arm_limits: Floats) -> Floats:
    """Return ``state`` (14,) with each combination of bones mirrored in depth, (16, 14)."""
    of = body_of(body)
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, directions, ray = np.empty((3, 3)), np.empty(6), np.empty(3)
    states = np.empty((16, state.shape[0]))
    state_pose(state, of.place, of.camera, rotation, hip)
    for i in range(16):
        for d in range(state.shape[0]):
            states[i, d] = state[d]
        for arm in range(2):
            angles, side = angles_in(states[i], arm), side_of(arm)
            pose_arm(angles, side, of.parts, of.girdle, points, directions)
            norm = 0.0
            for c in range(3):
                # Line of sight to the elbow, in the torso's frame.
                ray[c] = points[1, c]
                for r in range(3):
                    ray[c] += rotation[r, c] * hip[r]
                norm += ray[c] ** 2
            for c in range(3):
                ray[c] /= sqrt(norm)
            mirror(angles, side, (i >> (2 * arm)) & 3, ray, arm_limits, directions)
    return states


@kernel
def turned_states(states: Floats, turn_rad: float, arm_limits: Floats) -> Floats:
    """Return ``states`` (N, 14) of people who face the other way, with the same places of joints.

    The torso's rotation is Rz(yaw) Ry(pitch) Rx(roll) Rz(pi), whose turn about the vertical is
    written as ``turn_rad``, pi or -pi. What was the left arm is the right one.
    """
    turned, directions = states.copy(), np.empty(6)
    for i in range(states.shape[0]):
        turned[i, YAW] += turn_rad
        turned[i, PITCH], turned[i, ROLL] = -states[i, PITCH], -states[i, ROLL]
        for arm in range(2):
            limb_directions(angles_in(states[i], arm), side_of(arm), directions)
            for half in range(2):
                directions[3 * half] *= -1.0
                directions[3 * half + 1] *= -1.0
            other = 1 - arm
            angles_of_arm(directions, side_of(other), arm_limits, angles_in(turned[i], other))
    return turned
