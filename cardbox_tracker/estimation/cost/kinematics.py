"""Compiled kinematics: torso, limbs and keypoints in the torso's and in the optical frame.

The shoulder girdle lifts the shoulders with the arms; the frames are those of
:mod:`cardbox_tracker.body.kinematics`. Matrix products are written out, because calls of BLAS are
slow for such small matrices.
"""

from __future__ import annotations

from math import acos, asin, atan2, cos, pi, sin
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import ARM_ANGLES, FIRST_ANGLES, TORSO_X, TORSO_Z
from cardbox_tracker.compiling import copied_kernel, inlined_kernel, kernel
from cardbox_tracker.estimation.cost.kernel_arguments import (
    ASIDE,
    CLAVICLE,
    FOREARM,
    HEIGHT,
    LIFT_FROM,
    LIFT_GAIN,
    UPPER_ARM,
    UPWARDS,
    BodyTuple,
    Floats,
    Intrinsics,
    Place,
    body_of,
)


@inlined_kernel
def torso_pose(
    torso: Floats, place: Place, camera: Intrinsics, rotation: Floats, hip: Floats
) -> None:
    """Write rotation (3, 3) and mid-hip (3,) of the torso in the optical frame for d1..d4.

    Its rotation in the reference frame is Rz(yaw) Ry(pitch) Rx(roll), with c and s for cos and sin:

        cw cp    cw sp sr - sw cr    cw sp cr + sw sr
        sw cp    sw sp sr + cw cr    sw sp cr - cw sr
        -sp      cp sr               cp cr

    A camera that looks down by v has the axes

        x = Y,    y = -cos v Z + sin v X,    z = -sin v Z - cos v X
    """
    y_m, roll, pitch, yaw = torso[0], torso[1], torso[2], torso[3]
    cr, sr = cos(roll), sin(roll)
    cp, sp = cos(pitch), sin(pitch)
    cw, sw = cos(yaw), sin(yaw)
    cv, sv = camera.cos_pitch, camera.sin_pitch
    for j in range(3):
        if j == 0:
            x, y, z = cw * cp, sw * cp, -sp
        elif j == 1:
            x, y, z = cw * sp * sr - sw * cr, sw * sp * sr + cw * cr, cp * sr
        else:
            x, y, z = cw * sp * cr + sw * sr, sw * sp * cr - cw * sr, cp * cr
        rotation[0, j] = y
        rotation[1, j] = -cv * z + sv * x
        rotation[2, j] = -sv * z - cv * x
    hip[0] = y_m
    hip[1] = -cv * place.hip_height_m - sv * place.distance_m
    hip[2] = -sv * place.hip_height_m + cv * place.distance_m


@inlined_kernel
def turn_limb(parent: Floats, abduction: float, flexion: float, rotation: Floats) -> None:
    """Write parent Rx(abduction) Ry(-flexion), each (3, 3).

    With a and f for the angles, the columns of the parent (px, py, pz) become

        cos f px + sin f z,    y,    cos f z - sin f px

    where y = cos a py + sin a pz and z = cos a pz - sin a py.
    """
    ca, sa = cos(abduction), sin(abduction)
    cf, sf = cos(flexion), sin(flexion)
    for j in range(3):
        px, py, pz = parent[j, 0], parent[j, 1], parent[j, 2]
        y = ca * py + sa * pz
        z = ca * pz - sa * py
        rotation[j, 0] = cf * px + sf * z
        rotation[j, 1] = y
        rotation[j, 2] = cf * z - sf * px


class PosedArm(NamedTuple):
    """Scratch arrays of one arm."""

    points: Floats
    """(3, 3): shoulder, elbow, hand in the torso's frame, metres."""
    directions: Floats
    """(6,): unit vectors of upper arm and forearm in the torso's frame."""
    joints: Floats
    """(3, 3): the points in the optical frame, metres."""
    axes: Floats
    """(2, 3): the directions in the optical frame."""
    outward: Floats
    """(6,): the directions with y outwards, for the arms' prior; otherwise scratch."""


@inlined_kernel
def new_arm() -> PosedArm:
    """Return the scratch arrays of one arm."""
    return PosedArm(
        points=np.empty((3, 3)),
        directions=np.empty(6),
        joints=np.empty((3, 3)),
        axes=np.empty((2, 3)),
        outward=np.empty(6),
    )


@inlined_kernel
def first_angle(arm: int) -> int:
    """Return the index in a state of the first angle of the left arm, 0, or the right arm, 1."""
    return FIRST_ANGLES[arm]


@copied_kernel
def angles_in(state: Floats, arm: int) -> Floats:
    """Return the angles (4,) of the left arm, 0, or the right arm, 1, of a state or posture."""
    first = first_angle(arm)
    return state[first : first + ARM_ANGLES]


@inlined_kernel
def side_of(arm: int) -> float:
    """Return 1 for the left arm, 0, and -1 for the right arm, 1; only abduction is mirrored."""
    return 1.0 - 2.0 * arm


@inlined_kernel
def state_pose(
    state: Floats, place: Place, camera: Intrinsics, rotation: Floats, hip: Floats
) -> None:
    """Write rotation (3, 3) and mid-hip (3,) of a state's torso in the optical frame."""
    moved = Place(place.distance_m - state[TORSO_X], place.hip_height_m + state[TORSO_Z])
    torso_pose(state, moved, camera, rotation, hip)


@inlined_kernel
def limb_directions(angles: Floats, side: float, directions: Floats) -> None:
    """Write unit vectors of upper arm and forearm (6,) in the torso's frame for angles (4,).

    With the angles a, f of the shoulder, the upper arm's frame is Rx(a) Ry(-f), and the upper arm
    points along -Z of this frame. With the angles e, g of the elbow, the forearm's direction in
    this frame is (sin g, sin e cos g, -cos e cos g).
    """
    ca, sa = cos(side * angles[0]), sin(side * angles[0])
    cf, sf = cos(angles[1]), sin(angles[1])
    # Columns x, y and z of the upper arm's frame; the x component of column y is 0.
    x0, x1, x2 = cf, -sa * sf, ca * sf
    y1, y2 = ca, sa
    z0, z1, z2 = -sf, -sa * cf, ca * cf
    ce, se = cos(side * angles[2]), sin(side * angles[2])
    cg, sg = cos(angles[3]), sin(angles[3])
    w0, w1, w2 = sg, se * cg, -ce * cg
    directions[0], directions[1], directions[2] = -z0, -z1, -z2
    directions[3] = x0 * w0 + z0 * w2
    directions[4] = x1 * w0 + y1 * w1 + z1 * w2
    directions[5] = x2 * w0 + y2 * w1 + z2 * w2


@inlined_kernel
def pose_arm(
    angles: Floats, side: float, parts: Floats, girdle: Floats, points: Floats, directions: Floats
) -> None:
    """Write shoulder, elbow, hand (3, 3) and the directions (6,) of an arm in the torso's frame.

    The girdle lifts the shoulder on a circle of radius r by b = gain (elevation - start):

        aside = aside0 - r (1 - cos b),    upwards = upwards0 + r sin b
    """
    limb_directions(angles, side, directions)
    elevation = acos(min(max(-directions[2], -1.0), 1.0))
    lift = girdle[LIFT_GAIN] * max(elevation - girdle[LIFT_FROM], 0.0)
    points[0, 0] = 0.0
    points[0, 1] = side * (girdle[ASIDE] - girdle[CLAVICLE] * (1.0 - cos(lift)))
    points[0, 2] = girdle[UPWARDS] + girdle[CLAVICLE] * sin(lift)
    for c in range(3):
        points[1, c] = points[0, c] + parts[UPPER_ARM, HEIGHT] * directions[c]
        points[2, c] = points[1, c] + parts[FOREARM, HEIGHT] * directions[3 + c]


@inlined_kernel
def turn_arm(arm: PosedArm, rotation: Floats, hip: Floats) -> None:
    """Write joints and axes of an arm in the optical frame from those in the torso's."""
    for j in range(3):
        a, b, c = rotation[j, 0], rotation[j, 1], rotation[j, 2]
        for i in range(3):
            point = arm.points[i, 0] * a + arm.points[i, 1] * b + arm.points[i, 2] * c
            arm.joints[i, j] = hip[j] + point
        for i in range(2):
            o = 3 * i
            arm.axes[i, j] = (
                arm.directions[o] * a + arm.directions[o + 1] * b + arm.directions[o + 2] * c
            )


@inlined_kernel
def angles_of_arm(directions: Floats, side: float, limits: Floats, angles: Floats) -> None:
    """Write the angles (4,) of an arm with ``directions`` (6,) in the torso's frame.

    This is the inverse of :func:`limb_directions`, within ``limits`` (4, 2).
    """
    flexion = asin(min(max(directions[0], -1.0), 1.0))
    turned = atan2(directions[1], -directions[2])
    abduction = side * turned
    if abduction < -0.5 * pi:
        abduction += 2.0 * pi
    ca, sa = cos(turned), sin(turned)
    cf, sf = cos(flexion), sin(flexion)
    u, v, w = directions[3], directions[4], directions[5]
    # Coordinates of the forearm in the upper arm's frame.
    along_x = cf * u - sa * sf * v + ca * sf * w
    along_y = ca * v + sa * w
    along_z = -sf * u - sa * cf * v + ca * cf * w
    angles[0], angles[1] = abduction, flexion
    angles[2] = side * atan2(along_y, -along_z)
    angles[3] = asin(min(max(along_x, -1.0), 1.0))
    for i in range(4):
        angles[i] = min(max(angles[i], limits[i, 0]), limits[i, 1])


@kernel
def angles_of_arms(directions: Floats, side: float, limits: Floats) -> Floats:
    """Return the angles (N, 4) of arms with ``directions`` (N, 6), within ``limits`` (4, 2)."""
    angles = np.empty((directions.shape[0], 4))
    for i in range(directions.shape[0]):
        angles_of_arm(directions[i], side, limits, angles[i])
    return angles


@kernel
def keypoints(state: Floats, body: BodyTuple, points: Floats) -> None:
    """Write shoulder, elbow, hand of the left, then the right arm to ``points`` (6, 3).

    The points are in the optical frame, metres.
    """
    of = body_of(body)
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    state_pose(state, of.place, of.camera, rotation, hip)
    for k in range(2):
        pose_arm(angles_in(state, k), side_of(k), of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, rotation, hip)
        for i in range(3):
            for j in range(3):
                points[3 * k + i, j] = arm.joints[i, j]
