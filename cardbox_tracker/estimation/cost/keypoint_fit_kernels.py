"""Compiled fit of a state to wanted keypoints.

Inverse kinematics gives the initial state. It leaves residuals, because bones and torso angles are
fixed and the joints have limits; Gauss-Newton steps distribute them over all values. With the
Jacobian J of the keypoints K(state) and damping in units of ``stddev``, each step solves

    (J' J / SPREAD_M^2 + diag(1 / stddev^2)) change = J' (wanted - K(state)) / SPREAD_M^2
"""

from __future__ import annotations

from math import atan2, cos, pi, sin

import numpy as np

from cardbox_tracker.body.kinematics import first_angle, keypoints, pose_arm, side_of, state_pose
from cardbox_tracker.body.posture import ARM_ANGLES, N_STATE, TORSO_X, TORSO_Y, TORSO_Z
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.kernel_arguments import BodyTuple, Floats, body_of
from cardbox_tracker.estimation.cost.linear_kernels import solve

KEYPOINTS = 6
SPREAD_M = 0.01
"""Distance to a wanted keypoint that costs as much as one ``stddev`` of a joint."""


@kernel
def pose_at_keypoints(state: Floats, body: BodyTuple, wanted: Floats, limits: Floats) -> None:
    """Change arms and place of ``state`` (14,) so that its keypoints are near ``wanted``.

    This is inverse kinematics: bones point to the wanted keypoints as far as the limits allow; the
    forearm starts at the resulting elbow. The torso keeps its angles and moves so that the middle
    of the shoulders is the wanted one.

    Args:
        state: initial state; changed in place.
        body: fields of :class:`~.kernel_arguments.Body`.
        wanted: keypoints (6, 3), metres in the optical frame.
        limits: lowest and highest value of each, (14, 2).
    """
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, ahead, now = np.empty((3, 3)), np.empty(3), np.empty((KEYPOINTS, 3))
    directions = np.empty(6)
    of = body_of(body)
    state_pose(state, of.place, of.camera, rotation, hip)
    for arm in range(2):
        first, side = first_angle(arm), side_of(arm)
        angles = state[first : first + ARM_ANGLES]
        within = limits[first : first + ARM_ANGLES]
        shoulder, elbow, hand = wanted[3 * arm], wanted[3 * arm + 1], wanted[3 * arm + 2]
        _in_torso(rotation, shoulder, elbow, ahead)
        # With a for the abduction and f for the flexion, the upper arm points along
        # (sin f, sin a cos f, -cos a cos f).
        abduction = _nearest(side * atan2(ahead[1], -ahead[2]), within[0, 0], within[0, 1])
        ca, sa = cos(side * abduction), sin(side * abduction)
        flexion = atan2(ahead[0], sa * ahead[1] - ca * ahead[2])
        angles[0], angles[1] = abduction, _nearest(flexion, within[1, 0], within[1, 1])
        pose_arm(angles, side, of.parts, of.girdle, points, directions)
        # Direction of the forearm from the present elbow.
        _in_torso(rotation, shoulder, hand, ahead)
        for c in range(3):
            ahead[c] += points[0, c] - points[1, c]
        cf, sf = cos(angles[1]), sin(angles[1])
        along_x = cf * ahead[0] - sa * sf * ahead[1] + ca * sf * ahead[2]
        along_y = ca * ahead[1] + sa * ahead[2]
        along_z = -sf * ahead[0] - sa * cf * ahead[1] + ca * cf * ahead[2]
        turned = _nearest(side * atan2(along_y, -along_z), within[2, 0], within[2, 1])
        ce, se = cos(side * turned), sin(side * turned)
        bent = atan2(along_x, se * along_y - ce * along_z)
        angles[2], angles[3] = turned, _nearest(bent, within[3, 0], within[3, 1])
    keypoints(state, of, now)
    for c in range(3):
        ahead[c] = 0.5 * (wanted[0, c] + wanted[3, c] - now[0, c] - now[3, c])
    cos_pitch, sin_pitch = of.camera.cos_pitch, of.camera.sin_pitch
    state[TORSO_Y] += ahead[0]
    state[TORSO_X] += sin_pitch * ahead[1] - cos_pitch * ahead[2]
    state[TORSO_Z] += -cos_pitch * ahead[1] - sin_pitch * ahead[2]
    for j in (TORSO_Y, TORSO_X, TORSO_Z):
        state[j] = min(max(state[j], limits[j, 0]), limits[j, 1])


@kernel
def _in_torso(rotation: Floats, begin: Floats, end: Floats, ahead: Floats) -> None:
    """Write the difference of two optical points to ``ahead``, in the torso's frame."""
    for c in range(3):
        ahead[c] = 0.0
        for r in range(3):
            ahead[c] += rotation[r, c] * (end[r] - begin[r])


@kernel
def _nearest(angle: float, least: float, most: float) -> float:
    """Return ``angle``, rad, or the nearer limit, measured around the circle."""
    middle = 0.5 * (least + most)
    off = (angle - middle + pi) % (2.0 * pi) - pi
    return min(max(middle + off, least), most)


@kernel
def fit_keypoints(
    state: Floats,
    body: BodyTuple,
    wanted: Floats,
    stddev: Floats,
    limits: Floats,
    steps: Floats,
    count: int,
) -> None:
    """Change ``state`` (14,) in place, by ``count`` steps.

    Args:
        state: initial state; changed in place.
        body: fields of :class:`~.kernel_arguments.Body`.
        wanted: keypoints (6, 3), metres in the optical frame.
        stddev: standard deviations of the change, (14,); a value with 0 stays constant.
        limits: lowest and highest value of each, (14, 2).
        steps: steps of the central differences, (14,).
        count: number of steps.
    """
    of, trial = body_of(body), state.copy()
    now = np.empty((KEYPOINTS, 3))
    above, below = np.empty_like(now), np.empty_like(now)
    jacobian = np.empty((N_STATE, KEYPOINTS * 3))
    matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
    scale = 1.0 / (SPREAD_M * SPREAD_M)
    for _ in range(count):
        keypoints(state, of, now)
        for j in range(N_STATE):
            if stddev[j] == 0.0:
                jacobian[j] = 0.0
                continue
            trial[:] = state
            trial[j] = state[j] + steps[j]
            keypoints(trial, of, above)
            trial[j] = state[j] - steps[j]
            keypoints(trial, of, below)
            for i in range(KEYPOINTS * 3):
                jacobian[j, i] = (above[i // 3, i % 3] - below[i // 3, i % 3]) / (2.0 * steps[j])
        for j in range(N_STATE):
            for k in range(j + 1):
                total = 0.0
                for i in range(KEYPOINTS * 3):
                    total += jacobian[j, i] * jacobian[k, i]
                matrix[j, k] = scale * total
            matrix[j, j] += 1.0 if stddev[j] == 0.0 else 1.0 / stddev[j] ** 2
            total = 0.0
            for i in range(KEYPOINTS * 3):
                total += jacobian[j, i] * (wanted[i // 3, i % 3] - now[i // 3, i % 3])
            change[j] = scale * total
        solve(matrix, change)
        for j in range(N_STATE):
            state[j] = min(max(state[j] + change[j], limits[j, 0]), limits[j, 1])
