"""Compiled motions of the body's rigid segments, from which all Jacobians follow.

The segments are trunk, left upper arm, left forearm, right upper arm and right forearm. To first
order a point on their outline moves with its segment: where a round limb turns towards the camera,
its outline moves along the line of sight only. Each value of a state moves a segment and all those
beyond it as one rigid body, so its twist, six numbers in the optical frame, describes the motion of
all points.

A twist consists of the velocity v of the point that is at the camera's centre, and the angular
velocity w: the point X has the velocity v + w x X. A point's force f = d(distance)/dX and torque
X x f give the derivative of its distance by a value as f . v + (X x f) . w.
"""

from __future__ import annotations

from math import acos, cos, sin

import numpy as np

from cardbox_tracker.body.posture import (
    ARM_ANGLES,
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    PITCH,
    ROLL,
    SHOULDER_ABDUCTION,
    SHOULDER_FLEXION,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    YAW,
)
from cardbox_tracker.compiling import inlined_kernel, kernel
from cardbox_tracker.estimation.cost.body_outline import TRUNK_PATCHES
from cardbox_tracker.estimation.cost.kernel_arguments import (
    CLAVICLE,
    LIFT_FROM,
    LIFT_GAIN,
    Body,
    BodyTuple,
    Floats,
    body_of,
)
from cardbox_tracker.estimation.cost.kinematics import (
    angles_in,
    first_angle,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)

TWIST = 6
# The bar of a limb, and the square at its end.
_PATCHES_OF_LIMB = 2
# The nearest segment that a value moves, in the order of a state.
_MOVED = (0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0)


@inlined_kernel
def segment_of(patch: int) -> int:
    """Return the segment of a patch."""
    return 0 if patch < TRUNK_PATCHES else 1 + (patch - TRUNK_PATCHES) // _PATCHES_OF_LIMB


@inlined_kernel
def moves(value: int, segment: int) -> bool:
    """Return whether a value of a state moves a segment."""
    nearest = _MOVED[value]
    return nearest == segment or nearest == 0 or (nearest % 2 == 1 and segment == nearest + 1)


@inlined_kernel
def write_velocity(twist: Floats, point: Floats, velocity: Floats) -> None:
    """Write the velocity v + w x X (3,) of a point X (3,) that moves with a twist (v, w), (6,)."""
    velocity[0] = twist[0] + twist[4] * point[2] - twist[5] * point[1]
    velocity[1] = twist[1] + twist[5] * point[0] - twist[3] * point[2]
    velocity[2] = twist[2] + twist[3] * point[1] - twist[4] * point[0]


@inlined_kernel
def _turn_about(
    axis: tuple[float, float, float], rotation: Floats, at: Floats, twist: Floats
) -> None:
    """Write the twist (6,) of a rotation about an axis through the point ``at`` (3,).

    ``rotation`` (3, 3) turns the axis into the optical frame, in which the point is, metres.
    """
    x, y, z = axis
    a = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
    b = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
    c = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
    twist[0], twist[1] = at[1] * c - at[2] * b, at[2] * a - at[0] * c
    twist[2] = at[0] * b - at[1] * a
    twist[3], twist[4], twist[5] = a, b, c


@inlined_kernel
def _trunk_twists(state: Floats, of: Body, rotation: Floats, hip: Floats, twists: Floats) -> None:
    """Write the twists of the values that move the whole body.

    The torso's rotation is Rz(yaw) Ry(pitch) Rx(roll), so in the torso's frame the axes are

        roll: (1, 0, 0),    pitch: (0, cr, -sr),    yaw: (-sp, cp sr, cp cr)
    """
    cv, sv = of.camera.cos_pitch, of.camera.sin_pitch
    cr, sr = cos(state[ROLL]), sin(state[ROLL])
    cp, sp = cos(state[PITCH]), sin(state[PITCH])
    for j in (TORSO_Y, TORSO_X, TORSO_Z):
        for k in range(TWIST):
            twists[j, k] = 0.0
    twists[TORSO_Y, 0] = 1.0
    twists[TORSO_X, 1], twists[TORSO_X, 2] = sv, -cv
    twists[TORSO_Z, 1], twists[TORSO_Z, 2] = -cv, -sv
    _turn_about((1.0, 0.0, 0.0), rotation, hip, twists[ROLL])
    _turn_about((0.0, cr, -sr), rotation, hip, twists[PITCH])
    _turn_about((-sp, cp * sr, cp * cr), rotation, hip, twists[YAW])


@inlined_kernel
def _arm_twists(
    angles: Floats, side: float, girdle: Floats, joints: Floats, rotation: Floats, twists: Floats
) -> None:
    """Write the twists (4, 6) of the angles (4,) of an arm.

    With the angles a, f of the shoulder and e of the elbow, as in ``limb_directions``, the axes in
    the torso's frame are (1, 0, 0) and -(0, ca, sa), then the axes x and -(ce y + se z) of the
    upper arm. The elevation arccos(ca cf) also lifts the shoulder.
    """
    ca, sa = cos(side * angles[SHOULDER_ABDUCTION]), sin(side * angles[SHOULDER_ABDUCTION])
    cf, sf = cos(angles[SHOULDER_FLEXION]), sin(angles[SHOULDER_FLEXION])
    ce, se = cos(side * angles[ELBOW_ABDUCTION]), sin(side * angles[ELBOW_ABDUCTION])
    shoulder, elbow = joints[0], joints[1]
    _turn_about((side, 0.0, 0.0), rotation, shoulder, twists[SHOULDER_ABDUCTION])
    _turn_about((0.0, -ca, -sa), rotation, shoulder, twists[SHOULDER_FLEXION])
    x = side * cf, -side * sa * sf, side * ca * sf
    _turn_about(x, rotation, elbow, twists[ELBOW_ABDUCTION])
    across = se * sf, se * sa * cf - ce * ca, -se * ca * cf - ce * sa
    _turn_about(across, rotation, elbow, twists[ELBOW_FLEXION])
    elevation = acos(min(max(ca * cf, -1.0), 1.0))
    if elevation > girdle[LIFT_FROM]:
        lift = girdle[LIFT_GAIN] * (elevation - girdle[LIFT_FROM])
        per_lift = girdle[CLAVICLE] * girdle[LIFT_GAIN] / max(sin(elevation), 1e-6)
        aside, upwards = -side * sin(lift) * per_lift, cos(lift) * per_lift
        for k in range(3):
            along = rotation[k, 1] * aside + rotation[k, 2] * upwards
            twists[SHOULDER_ABDUCTION, k] += side * sa * cf * along
            twists[SHOULDER_FLEXION, k] += ca * sf * along


@kernel
def write_twists(state: Floats, body: BodyTuple, twists: Floats) -> None:
    """Write the twists (14, 6) of the values of ``state`` (14,), in the optical frame."""
    of = body_of(body)
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    state_pose(state, of.place, of.camera, rotation, hip)
    _trunk_twists(state, of, rotation, hip, twists)
    for k in range(2):
        angles, first = angles_in(state, k), first_angle(k)
        pose_arm(angles, side_of(k), of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, rotation, hip)
        here = twists[first : first + ARM_ANGLES]
        _arm_twists(angles, side_of(k), of.girdle, arm.joints, rotation, here)
