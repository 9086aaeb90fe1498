"""Compiled cost of a detector's points.

The residual of a point is its distance in the image from the projected joint, in units of its
deviation; a joint's deviation in metres becomes smaller in the image with the distance. The
residual of a bone is the difference between its component along a line of sight, as a fraction of
its length, and that of the detector's own points in space. Both are limited:

    cost = sum of score * MOST * (1 - exp(-residual^2 / MOST))
"""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M
from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    TWIST,
    PosedArm,
    angles_in,
    moves,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    state_twists,
    turn_arm,
    write_velocity,
)
from cardbox_tracker.person.parts import BOTTOM, FORWARD, HEAD, HEIGHT
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.proportions import WRIST_SHARE
from cardbox_tracker.terms.kernel_arguments import (
    Body,
    BodyTuple,
    Drawn,
    Floats,
    Intrinsics,
    body_of,
)

# Joints with a point: four of each arm, the middle of the hips, and the middle of the ears.
SHOULDER, ELBOW, WRIST, KNUCKLES = 0, 1, 2, 3
POINTS_OF_ARM = KNUCKLES + 1
HIPS = 2 * POINTS_OF_ARM
EARS, N_POINTS = HIPS + 1, HIPS + 2
# The middle of the shoulders, which has no point of its own.
NECK = N_POINTS
# Bones: upper arm and forearm of each arm, the line from the right to the left shoulder, and the
# trunk from the hips to the neck.
SHOULDERS = 4
TRUNK, N_BONES = SHOULDERS + 1, SHOULDERS + 2
N_RESIDUALS = 2 * N_POINTS + N_BONES
# The rigid segment to which each point belongs; the arm's elevation raises its shoulder.
_SEGMENT = (1, 1, 2, 2, 3, 3, 4, 4, 0, 0)

MOST = 16.0
"""Limit of a squared residual in a rating."""
PULL = 4.0 * MOST
"""The same in a fit: a point that is too far away to count in the cost still pulls."""


class Evidence(NamedTuple):
    """The points of one camera in one frame."""

    #: column, row and score of each point, (10, 3); a score of 0 for an unknown point.
    points: Floats
    deviations: Floats  #: of each point, metres and px, (10, 2)
    #: component along ``away`` as a fraction of the length, score and deviation of each bone, (6,
    #: 3).
    bones: Floats
    away: Floats  #: unit vector in the optical frame for each bone, (6, 3)


EvidenceTuple = tuple[Floats, Floats, Floats, Floats]
Found = tuple[Floats, Floats, Floats]
"""Values, Jacobian and costs of :class:`~cardbox_tracker.common.least_squares.Residuals`."""


@inlined_kernel
def _place_trunk(rotation: Floats, hip: Floats, of: Body, points: Floats) -> None:
    """Write hips and ears to ``points`` (10, 3), metres in the optical frame."""
    forward, up = of.parts[HEAD, FORWARD], of.parts[HEAD, BOTTOM] + 0.5 * of.parts[HEAD, HEIGHT]
    for c in range(3):
        points[HIPS, c] = hip[c]
        points[EARS, c] = hip[c] + rotation[c, 0] * forward + rotation[c, 2] * up


@inlined_kernel
def _place_arm(
    angles: Floats,
    arm: int,
    rotation: Floats,
    hip: Floats,
    of: Body,
    posed: PosedArm,
    points: Floats,
) -> None:
    """Write the joints of the left arm, 0, or the right arm, 1, to ``points`` (10, 3)."""
    pose_arm(angles, side_of(arm), of.parts, of.girdle, posed.points, posed.directions)
    turn_arm(posed, rotation, hip)
    first = POINTS_OF_ARM * arm
    for c in range(3):
        elbow, hand = posed.joints[1, c], posed.joints[2, c]
        points[first + SHOULDER, c] = posed.joints[0, c]
        points[first + ELBOW, c] = elbow
        points[first + WRIST, c] = elbow + WRIST_SHARE * (hand - elbow)
        points[first + KNUCKLES, c] = hand


@inlined_kernel
def _place_body(
    state: Floats,
    arms_of: Floats,
    of: Body,
    scratch: tuple[Floats, Floats],
    posed: PosedArm,
    points: Floats,
) -> None:
    """Write points and neck (11, 3) of the torso of ``state``, with the arms of ``arms_of``."""
    rotation, hip = scratch
    state_pose(state, of.place, of.camera, rotation, hip)
    _place_trunk(rotation, hip, of, points)
    for arm in range(2):
        _place_arm(angles_in(arms_of, arm), arm, rotation, hip, of, posed, points)
    for c in range(3):
        points[NECK, c] = 0.5 * (points[SHOULDER, c] + points[POINTS_OF_ARM + SHOULDER, c])


@inlined_kernel
def residual(i: int, points: Floats, camera: Intrinsics, seen: Evidence) -> tuple[float, float]:
    """Return the residuals of point ``i`` across and down, in units of its deviation."""
    z = max(points[i, 2], NEAREST_M)
    u = camera.fx * points[i, 0] / z + camera.cx
    v = camera.fy * points[i, 1] / z + camera.cy
    metric = seen.deviations[i, 0] * camera.fx / z
    scale = 1.0 / sqrt(metric * metric + seen.deviations[i, 1] ** 2)
    return scale * (u - seen.points[i, 0]), scale * (v - seen.points[i, 1])


@inlined_kernel
def _along(begin: int, end: int, points: Floats, away: Floats) -> float:
    """Return the component along ``away`` of the unit vector from one point to another."""
    x = points[end, 0] - points[begin, 0]
    y = points[end, 1] - points[begin, 1]
    z = points[end, 2] - points[begin, 2]
    length = sqrt(x * x + y * y + z * z) + 1e-9
    along: float = (x * away[0] + y * away[1] + z * away[2]) / length
    return along


@inlined_kernel
def bone_ends(bone: int) -> tuple[int, int]:
    """Return the points at which a bone begins and ends."""
    if bone == TRUNK:
        return HIPS, NECK
    if bone == SHOULDERS:
        return POINTS_OF_ARM + SHOULDER, SHOULDER
    first, is_forearm = POINTS_OF_ARM * (bone // 2), bone % 2 == 1
    begin, end = (ELBOW, KNUCKLES) if is_forearm else (SHOULDER, ELBOW)
    return first + begin, first + end


@inlined_kernel
def bone_residual(bone: int, points: Floats, seen: Evidence) -> float:
    """Return the residual of a bone, in units of its deviation."""
    begin, end = bone_ends(bone)
    along = _along(begin, end, points, seen.away[bone])
    residual: float = (along - seen.bones[bone, 0]) / seen.bones[bone, 2]
    return residual


@inlined_kernel
def _limited(score: float, square: float) -> float:
    """Return the cost of a squared residual."""
    return score * MOST * (1.0 - exp(-square / MOST)) if score > 0.0 else 0.0


@inlined_kernel
def _pulled(score: float, square: float) -> float:
    """Return the cost of a squared residual in a fit, where farther points still pull."""
    return score * PULL * (1.0 - exp(-square / PULL)) if score > 0.0 else 0.0


@inlined_kernel
def _cost_of_point(i: int, points: Floats, camera: Intrinsics, seen: Evidence) -> float:
    across, down = residual(i, points, camera, seen)
    return _limited(seen.points[i, 2], across * across + down * down)


@inlined_kernel
def _cost_of_bone(bone: int, points: Floats, seen: Evidence) -> float:
    return _limited(seen.bones[bone, 1], bone_residual(bone, points, seen) ** 2)


@inlined_kernel
def _cost_of_arm(arm: int, points: Floats, camera: Intrinsics, seen: Evidence) -> float:
    first, total = POINTS_OF_ARM * arm, 0.0
    for i in range(first, first + POINTS_OF_ARM):
        total += _cost_of_point(i, points, camera, seen)
    for bone in range(2 * arm, 2 * arm + 2):
        total += _cost_of_bone(bone, points, seen)
    return total


@inlined_kernel
def _cost_of_trunk(points: Floats, camera: Intrinsics, seen: Evidence) -> float:
    total: float = _cost_of_point(HIPS, points, camera, seen)
    total += _cost_of_point(EARS, points, camera, seen)
    total += _cost_of_bone(SHOULDERS, points, seen) + _cost_of_bone(TRUNK, points, seen)
    return total


@kernel
def rate(
    states: Floats,
    arms_of: Floats,
    parts: Drawn,
    body: BodyTuple,
    evidence: EvidenceTuple,
    costs: Floats,
) -> None:
    """Write the costs (N,) of the parts of states (N, 14) that count.

    Trunks without arms count with their shoulders, which the arms of ``arms_of``, (N, 14) or
    (1, 14), raise.
    """
    of, seen = body_of(body), Evidence(*evidence)
    scratch, posed, points = (np.empty((3, 3)), np.empty(3)), new_arm(), np.empty((NECK + 1, 3))
    for i in range(states.shape[0]):
        lifting = arms_of[i if arms_of.shape[0] > 1 else 0]
        _place_body(states[i], lifting, of, scratch, posed, points)
        costs[i] = _cost_of_trunk(points, of.camera, seen) if parts[0] else 0.0
        for arm in range(2):
            if parts[1 + arm]:
                costs[i] += _cost_of_arm(arm, points, of.camera, seen)
            elif parts[0]:
                costs[i] += _cost_of_point(POINTS_OF_ARM * arm + SHOULDER, points, of.camera, seen)


@kernel
def residuals(states: Floats, body: BodyTuple, evidence: EvidenceTuple, found: Found) -> None:
    """Write residuals, their Jacobian and the costs of states (N, 14); see ``Residuals``.

    A point X of a rigid segment moves by v + w x X with the twist (v, w) of each value of the state
    that moves the segment (:mod:`cardbox_tracker.person.kinematics`).
    """
    of, seen = body_of(body), Evidence(*evidence)
    values, jacobian, costs = found
    scratch, posed, points = (np.empty((3, 3)), np.empty(3)), new_arm(), np.empty((NECK + 1, 3))
    twists, moved = np.empty((N_STATE, TWIST)), np.zeros((NECK + 1, 3, N_STATE))
    for n in range(states.shape[0]):
        state = states[n]
        _place_body(state, state, of, scratch, posed, points)
        state_twists(state, of, twists)
        for i in range(N_POINTS):
            for d in range(N_STATE):
                if moves(d, _SEGMENT[i]):
                    write_velocity(twists[d], points[i], moved[i, :, d])
        # An assignment of arrays would compile for longer than all the rest of this function.
        for c in range(3):
            for d in range(N_STATE):
                other = moved[POINTS_OF_ARM + SHOULDER, c, d]
                moved[NECK, c, d] = 0.5 * (moved[SHOULDER, c, d] + other)
        costs[n] = 0.0
        for i in range(N_POINTS):
            u, v = residual(i, points, of.camera, seen) if seen.points[i, 2] > 0.0 else (0.0, 0.0)
            root = sqrt(seen.points[i, 2] * exp(-(u * u + v * v) / PULL))
            costs[n] += _pulled(seen.points[i, 2], u * u + v * v)
            values[n, 2 * i], values[n, 2 * i + 1] = root * u, root * v
            z = max(points[i, 2], NEAREST_M)
            metric = seen.deviations[i, 0] * of.camera.fx / z
            variance = metric * metric + seen.deviations[i, 1] ** 2
            scale = root / sqrt(variance)
            # A nearer joint may also be farther away in the image.
            shrinks = metric * metric / (variance * z)
            x, y = points[i, 0] / z, points[i, 1] / z
            for d in range(N_STATE):
                dx, dy, dz = moved[i, 0, d], moved[i, 1, d], moved[i, 2, d]
                across, down = of.camera.fx * (dx - x * dz) / z, of.camera.fy * (dy - y * dz) / z
                jacobian[n, 2 * i, d] = scale * across + root * u * shrinks * dz
                jacobian[n, 2 * i + 1, d] = scale * down + root * v * shrinks * dz
        for bone in range(N_BONES):
            row = 2 * N_POINTS + bone
            score = seen.bones[bone, 1]
            value = bone_residual(bone, points, seen) if score > 0.0 else 0.0
            root = sqrt(max(score, 0.0) * exp(-(value * value) / PULL))
            costs[n] += _pulled(score, value * value)
            values[n, row] = root * value
            begin, end = bone_ends(bone)
            away, length, along = seen.away[bone], 1e-18, 0.0
            for c in range(3):
                part = points[end, c] - points[begin, c]
                length += part * part
                along += part * away[c]
            length = sqrt(length)
            along /= length
            for d in range(N_STATE):
                change = 0.0
                for c in range(3):
                    towards = away[c] - along * (points[end, c] - points[begin, c]) / length
                    change += towards * (moved[end, c, d] - moved[begin, c, d])
                jacobian[n, row, d] = root * change / (length * seen.bones[bone, 2])


@kernel
def project(state: Floats, body: BodyTuple, pixels: Floats) -> None:
    """Write column, row and depth of all points of a state (14,) to ``pixels`` (10, 3)."""
    of = body_of(body)
    scratch, posed, points = (np.empty((3, 3)), np.empty(3)), new_arm(), np.empty((NECK + 1, 3))
    _place_body(state, state, of, scratch, posed, points)
    for i in range(N_POINTS):
        z = max(points[i, 2], NEAREST_M)
        pixels[i, 0] = of.camera.fx * points[i, 0] / z + of.camera.cx
        pixels[i, 1] = of.camera.fy * points[i, 1] / z + of.camera.cy
        pixels[i, 2] = points[i, 2]
