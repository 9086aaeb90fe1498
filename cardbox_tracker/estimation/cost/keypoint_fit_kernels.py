"""Compiled: the state whose keypoints are nearest to where they are wanted.

The inverse of the kinematics finds it, but for what bones of given lengths, the torso's angles and
the limits do not allow. Gauss-Newton steps share that out. Each step solves, with the Jacobian J of
the keypoints K(state) and damping in units of ``stddev``,

    (J' J / SPREAD_M^2 + diag(1 / stddev^2)) change = J' (wanted - K(state)) / SPREAD_M^2

Who changes ``whole_body_kernels.py`` has to delete the cache of compiled code of this file.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin

import numpy as np

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, Place, PlaceTuple, View, ViewTuple
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    ARM_ANGLES,
    N_STATE,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    _first_angle,
    _pose,
    _pose_arm,
    _side_of,
    keypoints,
)

_compile = njit(cache=True, nogil=True, error_model="numpy")

KEYPOINTS = 6
SPREAD_M = 0.01
"""How near to the wanted places the keypoints come where a joint has to turn by a deviation."""


@_compile
def pose_at_keypoints(
    state: Floats,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    wanted: Floats,
    limits: Floats,
) -> None:
    """Change arms and place of ``state`` (14,) so that its keypoints are near ``wanted``.

    The inverse of the kinematics. Bones point where they are wanted to, or as near to that as the
    limits let them; a forearm begins at the elbow as it is then. The torso keeps its angles, and
    its place is such that the middle of the shoulders is the wanted one.

    Args:
        state: to begin with; changed.
        parts: as of :func:`~.whole_body_kernels.keypoints`, like the next three.
        girdle: see there.
        place: see there.
        view: see there.
        wanted: keypoints (6, 3), metres in the optical frame.
        limits: lowest and highest value of each, (14, 2).
    """
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, ahead, now = np.empty((3, 3)), np.empty(3), np.empty((KEYPOINTS, 3))
    directions = np.empty(6)
    _pose(state, Place(*place), View(*view), rotation, hip)
    for arm in range(2):
        first, side = _first_angle(arm), _side_of(arm)
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
        _pose_arm(angles, side, parts, girdle, points, directions)
        # Where the forearm would point from the elbow as it is now.
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
    keypoints(state, parts, girdle, place, view, now)
    for c in range(3):
        ahead[c] = 0.5 * (wanted[0, c] + wanted[3, c] - now[0, c] - now[3, c])
    cos_pitch, sin_pitch = view[4], view[5]
    state[TORSO_Y] += ahead[0]
    state[TORSO_X] += sin_pitch * ahead[1] - cos_pitch * ahead[2]
    state[TORSO_Z] += -cos_pitch * ahead[1] - sin_pitch * ahead[2]
    for j in (TORSO_Y, TORSO_X, TORSO_Z):
        state[j] = min(max(state[j], limits[j, 0]), limits[j, 1])


@_compile
def _in_torso(rotation: Floats, begin: Floats, end: Floats, ahead: Floats) -> None:
    """Write the way between two points of the optical frame to ``ahead``, in the torso's frame."""
    for c in range(3):
        ahead[c] = 0.0
        for r in range(3):
            ahead[c] += rotation[r, c] * (end[r] - begin[r])


@_compile
def _nearest(angle: float, least: float, most: float) -> float:
    """Return ``angle``, rad, or the limit that is the shorter way round from it."""
    middle = 0.5 * (least + most)
    off = (angle - middle + pi) % (2.0 * pi) - pi
    return min(max(middle + off, least), most)


@_compile
def fit_keypoints(
    state: Floats,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    wanted: Floats,
    stddev: Floats,
    limits: Floats,
    steps: Floats,
    count: int,
) -> None:
    """Change ``state`` (14,) in place, by ``count`` steps.

    Args:
        state: to begin with.
        parts: as of :func:`~.whole_body_kernels.keypoints`, like the next three.
        girdle: see there.
        place: see there.
        view: see there.
        wanted: keypoints (6, 3), metres in the optical frame.
        stddev: how easily each value of the state moves, (14,); 0: not at all.
        limits: lowest and highest value of each, (14, 2).
        steps: of the central differences, (14,).
        count: how many steps.
    """
    trial = state.copy()
    now = np.empty((KEYPOINTS, 3))
    above, below = np.empty_like(now), np.empty_like(now)
    jacobian = np.empty((N_STATE, KEYPOINTS * 3))
    matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
    scale = 1.0 / (SPREAD_M * SPREAD_M)
    for _ in range(count):
        keypoints(state, parts, girdle, place, view, now)
        for j in range(N_STATE):
            if stddev[j] == 0.0:
                jacobian[j] = 0.0
                continue
            trial[:] = state
            trial[j] = state[j] + steps[j]
            keypoints(trial, parts, girdle, place, view, above)
            trial[j] = state[j] - steps[j]
            keypoints(trial, parts, girdle, place, view, below)
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
