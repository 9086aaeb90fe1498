"""The kinematics of the upper body: where joints and parts of a person are in a posture.

All of the package places a body here. :func:`pose` and :func:`jacobian` take a person and states;
the search calls the kernels below them. The frames are those of ``docs/conventions.md`` (paper,
section II-A). The torso turns about the middle of the hips with Rz(yaw) Ry(pitch) Rx(roll). A limb
hangs along -Z of its frame:

    R_upper_arm = R_torso Rx(+-abduction) Ry(-flexion),   R_forearm = R_upper_arm Rx(..) Ry(..)

with + for the left arm and - for the right. A shoulder joint rises with its arm, see
:mod:`.skeleton`, unless the person's shoulders are rigid, as in the paper.

**Twists.** Each value of a state moves a part of the body and all beyond it as one rigid body. Its
twist consists of the velocity v of the point that is at the camera's centre, and the angular
velocity w: the point X has the velocity v + w x X.

Matrix products are written out, because calls of BLAS are slow for such small matrices.
"""

from __future__ import annotations

from functools import lru_cache
from math import acos, asin, atan2, cos, hypot, pi, sin
from typing import NamedTuple, Protocol

import numpy as np

from cardbox_tracker.common.compiling import (
    copied_kernel,
    inlined_allocation,
    inlined_kernel,
    kernel,
)
from cardbox_tracker.person.model import BodyModel, Person, Placement
from cardbox_tracker.person.parts import (
    BOTTOM,
    FOREARM,
    FORWARD,
    HEAD,
    HEIGHT,
    TORSO,
    UPPER_ARM,
    BodyParts,
    shape_of,
)
from cardbox_tracker.person.posture import (
    ARM_ANGLES,
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    FIRST_ANGLES,
    N_STATE,
    PITCH,
    ROLL,
    SHOULDER_ABDUCTION,
    SHOULDER_FLEXION,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    YAW,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    FRAME_NAMES,
    POINT_NAMES,
    RISE_FROM_RAD,
    RISE_INWARDS,
    RISE_UPWARDS,
    head_from_pivot_m,
    neck_pivot_m,
    neck_rotation,
)

# Values of ``girdle`` (3,): shoulder joint of a hanging arm in the torso's frame, metres; its rise
# per elevation of the arm, m/rad.
ASIDE, UPWARDS, RISE = 0, 1, 2
TWIST = 6
_HIP, _NECK, _HEAD, _ARMS = 0, 1, 2, 3
# The nearest segment that each value of a state moves, and the segment of each of POINT_NAMES.
_MOVED = (0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 0, 0)
_SEGMENTS = (0, 0, 0, 1, 1, 2, 3, 3, 4)
# The elevation of an arm that points straight up has no derivative.
_LEAST_SINE = 1e-6
_N_POINTS, _N_FRAMES = len(POINT_NAMES), len(FRAME_NAMES)


class Place(NamedTuple):
    """The middle of the hips in the reference frame: (-distance, d1, height), metres."""

    distance_m: float
    hip_height_m: float


class Pitched(Protocol):
    """A camera that looks down, or what knows the angle."""

    @property
    def cos_pitch(self) -> float:
        """Cosine of the pitch."""

    @property
    def sin_pitch(self) -> float:
        """Sine of the pitch."""


class Tilt(NamedTuple):
    """How far a camera looks down."""

    cos_pitch: float
    sin_pitch: float


class Boned(Protocol):
    """What kernels need to know of a person: the attributes of :class:`Bones`."""

    @property
    def parts(self) -> FloatArray: ...  # noqa: D102
    @property
    def girdle(self) -> FloatArray: ...  # noqa: D102
    @property
    def place(self) -> Place: ...  # noqa: D102
    @property
    def camera(self) -> Pitched: ...  # noqa: D102


class Bones(NamedTuple):
    """A person in a place before a camera; kernels get a plain tuple."""

    parts: FloatArray  #: six lengths of six parts, (6, 6), metres, see :func:`.parts.shape_of`
    girdle: FloatArray  #: shoulder joints and how they rise with the arms, (3,)
    place: Place  #: place of the hips
    camera: Pitched  #: pitch of the camera


BonesTuple = tuple[FloatArray, FloatArray, tuple[float, float], tuple[float, float]]


class Arm(NamedTuple):
    """One arm: joints (..., 3) in metres and rotations (..., 3, 3) from its parts."""

    shoulder: FloatArray
    elbow: FloatArray
    hand: FloatArray
    upper_arm_rotation: FloatArray
    forearm_rotation: FloatArray


class PosedBodies(NamedTuple):
    """Bodies in the reference frame, or in a camera's optical frame."""

    points_m: FloatArray  #: points of ``POINT_NAMES``, (..., 9, 3), metres
    rotations: FloatArray  #: rotations from the frames of ``FRAME_NAMES``, (..., 5, 3, 3)
    #: rise of the left and right shoulder, (..., 2), metres: the values of ``Group.CLAVICLE``.
    clavicles_m: FloatArray

    @property
    def hip(self) -> FloatArray:
        """Middle of the hips, (..., 3), the origin of the torso's frame."""
        return self.points_m[..., _HIP, :]

    @property
    def neck(self) -> FloatArray:
        """Middle of the torso's top, (..., 3)."""
        return self.points_m[..., _NECK, :]

    @property
    def head(self) -> FloatArray:
        """Middle of the head while the neck is straight, (..., 3)."""
        return self.points_m[..., _HEAD, :]

    @property
    def keypoints_m(self) -> FloatArray:
        """Points of ``KEYPOINT_NAMES``, (..., 6, 3)."""
        return self.points_m[..., _ARMS:, :]

    @property
    def torso_rotation(self) -> FloatArray:
        """Rotation from the torso's frame, (..., 3, 3)."""
        return self.rotations[..., 0, :, :]

    @property
    def left(self) -> Arm:
        """The left arm."""
        return self._arm(0)

    @property
    def right(self) -> Arm:
        """The right arm."""
        return self._arm(1)

    def _arm(self, arm: int) -> Arm:
        joints = self.points_m[..., _ARMS + 3 * arm : _ARMS + 3 * arm + 3, :]
        frames = self.rotations[..., 1 + 2 * arm : 3 + 2 * arm, :, :]
        return Arm(*np.moveaxis(joints, -2, 0), *np.moveaxis(frames, -3, 0))


def pose(
    body: BodyModel,
    states: FloatArray,
    pitch_rad: float | None = None,
    clavicles_m: FloatArray | None = None,
) -> PosedBodies:
    """Return a body in each state (..., 14), or posture (..., 12), rad and metres.

    The frame is the reference frame, or the optical one of a camera that looks down by
    ``pitch_rad``. Shoulders rise by ``clavicles_m`` (..., 2), metres; if it is None, with the arms,
    unless the body is ``rigid``.
    """
    flat, shape = _flat(states)
    points, rotations = np.empty((len(flat), _N_POINTS, 3)), np.empty((len(flat), _N_FRAMES, 3, 3))
    rises = np.empty((len(flat), 2))
    if clavicles_m is not None:
        rises[:] = np.reshape(clavicles_m, (-1, 2))
    bones = (*_bones(body.person, body.placement, body.shoulder_rise), _tilt(pitch_rad))
    _pose(flat, bones, clavicles_m is None, rises, points, rotations)
    if pitch_rad is None:
        points, rotations = _level(points, 2), _level(rotations, 2)
    return PosedBodies(
        points.reshape(*shape, _N_POINTS, 3),
        rotations.reshape(*shape, _N_FRAMES, 3, 3),
        rises.reshape(*shape, 2),
    )


def jacobian(body: BodyModel, states: FloatArray, pitch_rad: float | None = None) -> FloatArray:
    """Return derivatives (..., 9, 3, 14) of :attr:`PosedBodies.points_m`; see :func:`pose`."""
    flat, shape = _flat(states)
    derivatives = np.empty((len(flat), _N_POINTS, 3, N_STATE))
    bones = (*_bones(body.person, body.placement, body.shoulder_rise), _tilt(pitch_rad))
    _jacobian(flat, bones, derivatives)
    if pitch_rad is None:
        derivatives = _level(derivatives, 2)
    return derivatives.reshape(*shape, _N_POINTS, 3, N_STATE)


def clavicles(
    body: BodyModel, posture: FloatArray, stddev: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rise and standard deviation of both shoulders, (2,) each, metres.

    Posture and standard deviations are (12,), rad and metres.
    """
    found = np.empty(2), np.empty(2)
    _clavicles(posture, stddev, girdle_of(body), *found)
    return found


def gaze_m(parts: BodyParts[float], posed: PosedBodies, angles_rad: FloatArray) -> FloatArray:
    """Return both ends (2, 3), metres, of a line along the direction of the face.

    It begins in the middle of the head of the ``posed`` body, in whose frame it is, and is as long
    as the head is high. ``angles_rad`` (2,) are ``neck_yaw`` and ``neck_pitch``.
    """
    rotation = neck_rotation(angles_rad)
    middle = np.array(neck_pivot_m(parts)) + rotation @ head_from_pivot_m(parts)
    ends = np.array([middle, middle + parts.head.height_m * rotation[:, 0]])
    placed: FloatArray = posed.hip + ends @ posed.torso_rotation.T
    return placed


def girdle_of(body: BodyModel) -> FloatArray:
    """Return the values of ``girdle``, (3,), of a body."""
    return _bones(body.person, body.placement, body.shoulder_rise)[1]


@lru_cache(maxsize=64)
def _bones(
    person: Person, placement: Placement, shoulder_rise: float
) -> tuple[FloatArray, FloatArray, tuple[float, float]]:
    parts, shoulder = shape_of(person.sizes)
    girdle = np.array([*shoulder, shoulder_rise * person.size("shoulder_breadth")])
    return parts, girdle, (float(placement.distance_m), float(placement.hip_height_m))


def _tilt(pitch_rad: float | None) -> tuple[float, float]:
    return (1.0, 0.0) if pitch_rad is None else (float(np.cos(pitch_rad)), float(np.sin(pitch_rad)))


def _flat(states: FloatArray) -> tuple[FloatArray, tuple[int, ...]]:
    """Return states (N, 14) of postures or states (..., 12 or 14), and the leading shape."""
    given = np.asarray(states, np.float64)
    flat = np.zeros((given[..., 0].size, N_STATE))
    flat[:, : given.shape[-1]] = given.reshape(len(flat), -1)
    return flat, given.shape[:-1]


def _level(values: FloatArray, axis: int) -> FloatArray:
    """Return coordinates of a level camera's optical frame in the reference frame."""
    x, y, z = np.moveaxis(values, axis, 0)
    return np.stack([-z, x, -y], axis=axis)


@kernel
def _pose(
    states: FloatArray,
    bones: BonesTuple,
    follows: bool,
    rises: FloatArray,
    points: FloatArray,
    rotations: FloatArray,
) -> None:
    """Write points (N, 9, 3) and rotations (N, 5, 3, 3) of states, in the optical frame.

    If the shoulders follow the arms, ``rises`` (N, 2) is written, else read.
    """
    parts, girdle, where, tilt = bones
    place, camera, hip = Place(*where), Tilt(*tilt), np.empty(3)
    top = parts[TORSO, BOTTOM] + parts[TORSO, HEIGHT]
    forward, middle = parts[HEAD, FORWARD], parts[HEAD, BOTTOM] + 0.5 * parts[HEAD, HEIGHT]
    for i in range(states.shape[0]):
        at, torso = points[i], rotations[i, 0]
        state_pose(states[i], place, camera, torso, hip)
        for j in range(3):
            at[_HIP, j] = hip[j]
            at[_NECK, j] = hip[j] + top * torso[j, 2]
            at[_HEAD, j] = hip[j] + (forward * torso[j, 0] + middle * torso[j, 2])
        for k in range(2):
            angles, side, first = angles_in(states[i], k), side_of(k), _ARMS + 3 * k
            upper_arm, forearm = rotations[i, 1 + 2 * k], rotations[i, 2 + 2 * k]
            if follows:
                upright = cos(angles[SHOULDER_ABDUCTION]) * cos(angles[SHOULDER_FLEXION])
                rises[i, k] = rise_of(upright, girdle)
            aside, height = raised(rises[i, k], girdle)
            turn_limb(torso, side * angles[0], angles[1], upper_arm)
            turn_limb(upper_arm, side * angles[2], angles[3], forearm)
            for j in range(3):
                shoulder = hip[j] + side * aside * torso[j, 1] + height * torso[j, 2]
                elbow = shoulder - parts[UPPER_ARM, HEIGHT] * upper_arm[j, 2]
                at[first, j], at[first + 1, j] = shoulder, elbow
                at[first + 2, j] = elbow - parts[FOREARM, HEIGHT] * forearm[j, 2]


@kernel
def _clavicles(
    posture: FloatArray,
    stddev: FloatArray,
    girdle: FloatArray,
    rises: FloatArray,
    deviations: FloatArray,
) -> None:
    """Write rises (2,) and their deviations (2,) from those of the angles."""
    for k in range(2):
        angles, by = angles_in(posture, k), angles_in(stddev, k)
        cos_a, cos_f = cos(angles[SHOULDER_ABDUCTION]), cos(angles[SHOULDER_FLEXION])
        upright = cos_a * cos_f
        rises[k] = rise_of(upright, girdle)
        by_abduction = sin(angles[SHOULDER_ABDUCTION]) * cos_f * by[SHOULDER_ABDUCTION]
        by_flexion = sin(angles[SHOULDER_FLEXION]) * cos_a * by[SHOULDER_FLEXION]
        deviations[k] = _rise_by(upright, girdle) * hypot(by_abduction, by_flexion)


@kernel
def _jacobian(states: FloatArray, bones: BonesTuple, derivatives: FloatArray) -> None:
    """Write the derivatives (N, 9, 3, 14) of points by states, in the optical frame."""
    parts, girdle, where, tilt = bones
    of = Bones(parts, girdle, Place(*where), Tilt(*tilt))
    twists, at = np.empty((N_STATE, TWIST)), np.empty((1, _N_POINTS, 3))
    frames, rises = np.empty((1, _N_FRAMES, 3, 3)), np.empty((1, 2))
    derivatives[:] = 0.0
    for i in range(states.shape[0]):
        _pose(states[i : i + 1], bones, True, rises, at, frames)
        state_twists(states[i], of, twists)
        for p in range(_N_POINTS):
            for j in range(N_STATE):
                if moves(j, _SEGMENTS[p]):
                    write_velocity(twists[j], at[0, p], derivatives[i, p, :, j])


@inlined_kernel
def moves(value: int, segment: int) -> bool:
    """Return whether a value of a state moves a segment.

    The segments are trunk, left upper arm, left forearm, right upper arm and right forearm. A value
    moves the nearest one and all those beyond it as one rigid body.
    """
    nearest = _MOVED[value]
    return nearest == segment or nearest == 0 or (nearest % 2 == 1 and segment == nearest + 1)


@inlined_kernel
def write_velocity(twist: FloatArray, point: FloatArray, velocity: FloatArray) -> None:
    """Write the velocity v + w x X (3,) of a point X (3,) that moves with a twist (v, w), (6,)."""
    velocity[0] = twist[0] + twist[4] * point[2] - twist[5] * point[1]
    velocity[1] = twist[1] + twist[5] * point[0] - twist[3] * point[2]
    velocity[2] = twist[2] + twist[3] * point[1] - twist[4] * point[0]


@inlined_kernel
def torso_pose(
    torso: FloatArray, place: Place, camera: Pitched, rotation: FloatArray, hip: FloatArray
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
def state_pose(
    state: FloatArray, place: Place, camera: Pitched, rotation: FloatArray, hip: FloatArray
) -> None:
    """Write rotation (3, 3) and mid-hip (3,) of a state's torso in the optical frame."""
    moved = Place(place.distance_m - state[TORSO_X], place.hip_height_m + state[TORSO_Z])
    torso_pose(state, moved, camera, rotation, hip)


@inlined_kernel
def turn_limb(parent: FloatArray, abduction: float, flexion: float, rotation: FloatArray) -> None:
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

    points: FloatArray
    """(3, 3): shoulder, elbow, hand in the torso's frame, metres."""
    directions: FloatArray
    """(6,): unit vectors of upper arm and forearm in the torso's frame."""
    joints: FloatArray
    """(3, 3): the points in the optical frame, metres."""
    axes: FloatArray
    """(2, 3): the directions in the optical frame."""
    outward: FloatArray
    """(6,): the directions with y outwards, for the arms' prior; otherwise scratch."""


@inlined_allocation
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
def angles_in(state: FloatArray, arm: int) -> FloatArray:
    """Return the angles (4,) of the left arm, 0, or the right arm, 1, of a state or posture."""
    first = first_angle(arm)
    return state[first : first + ARM_ANGLES]


@inlined_kernel
def side_of(arm: int) -> float:
    """Return 1 for the left arm, 0, and -1 for the right arm, 1; only abduction is mirrored."""
    return 1.0 - 2.0 * arm


@inlined_kernel
def rise_of(upright: float, girdle: FloatArray) -> float:
    """Return the rise of a shoulder, metres; ``upright`` is the cosine of its arm's elevation."""
    elevation = acos(min(max(upright, -1.0), 1.0))
    rise: float = girdle[RISE] * max(elevation - RISE_FROM_RAD, 0.0)
    return rise


@inlined_kernel
def _rise_by(upright: float, girdle: FloatArray) -> float:
    """Return the derivative of :func:`rise_of` by -``upright``."""
    elevation = acos(min(max(upright, -1.0), 1.0))
    if elevation <= RISE_FROM_RAD:
        return 0.0
    slope: float = girdle[RISE] / max(sin(elevation), _LEAST_SINE)
    return slope


@inlined_kernel
def raised(rise_m: float, girdle: FloatArray) -> tuple[float, float]:
    """Return distance from the torso's middle and height of a shoulder joint, metres."""
    return girdle[ASIDE] - RISE_INWARDS * rise_m, girdle[UPWARDS] + RISE_UPWARDS * rise_m


@inlined_kernel
def limb_directions(angles: FloatArray, side: float, directions: FloatArray) -> None:
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
    angles: FloatArray,
    side: float,
    parts: FloatArray,
    girdle: FloatArray,
    points: FloatArray,
    directions: FloatArray,
) -> None:
    """Write shoulder, elbow, hand (3, 3) and the directions (6,) of an arm in the torso's frame."""
    limb_directions(angles, side, directions)
    aside, height = raised(rise_of(-directions[2], girdle), girdle)
    points[0, 0], points[0, 1], points[0, 2] = 0.0, side * aside, height
    for c in range(3):
        points[1, c] = points[0, c] + parts[UPPER_ARM, HEIGHT] * directions[c]
        points[2, c] = points[1, c] + parts[FOREARM, HEIGHT] * directions[3 + c]


@inlined_kernel
def turn_arm(arm: PosedArm, rotation: FloatArray, hip: FloatArray) -> None:
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
def _turn_about(
    axis: tuple[float, float, float], rotation: FloatArray, at: FloatArray, twist: FloatArray
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
def _trunk_twists(
    state: FloatArray, camera: Pitched, rotation: FloatArray, hip: FloatArray, twists: FloatArray
) -> None:
    """Write the twists of the values that move the whole body.

    The torso's rotation is Rz(yaw) Ry(pitch) Rx(roll), so in the torso's frame the axes are

        roll: (1, 0, 0),    pitch: (0, cr, -sr),    yaw: (-sp, cp sr, cp cr)
    """
    cv, sv = camera.cos_pitch, camera.sin_pitch
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
    angles: FloatArray,
    side: float,
    girdle: FloatArray,
    joints: FloatArray,
    rotation: FloatArray,
    twists: FloatArray,
) -> None:
    """Write the twists (4, 6) of the angles (4,) of an arm.

    With the angles a, f of the shoulder and e of the elbow, as in ``limb_directions``, the axes in
    the torso's frame are (1, 0, 0) and -(0, ca, sa), then the axes x and -(ce y + se z) of the
    upper arm. The elevation arccos(ca cf) also raises the shoulder.
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
    per_rad = _rise_by(ca * cf, girdle)
    if per_rad > 0.0:
        inwards, upwards = -side * RISE_INWARDS * per_rad, RISE_UPWARDS * per_rad
        for k in range(3):
            along = rotation[k, 1] * inwards + rotation[k, 2] * upwards
            twists[SHOULDER_ABDUCTION, k] += side * sa * cf * along
            twists[SHOULDER_FLEXION, k] += ca * sf * along


@kernel
def state_twists(state: FloatArray, of: Boned, twists: FloatArray) -> None:
    """Write the twists (14, 6) of the values of ``state`` (14,), in the optical frame."""
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    state_pose(state, of.place, of.camera, rotation, hip)
    _trunk_twists(state, of.camera, rotation, hip, twists)
    for k in range(2):
        angles, first = angles_in(state, k), first_angle(k)
        pose_arm(angles, side_of(k), of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, rotation, hip)
        here = twists[first : first + ARM_ANGLES]
        _arm_twists(angles, side_of(k), of.girdle, arm.joints, rotation, here)


@kernel
def keypoints(state: FloatArray, of: Boned, points: FloatArray) -> None:
    """Write the keypoints (6, 3) of ``state`` (14,) in the optical frame, metres."""
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    state_pose(state, of.place, of.camera, rotation, hip)
    for k in range(2):
        pose_arm(angles_in(state, k), side_of(k), of.parts, of.girdle, arm.points, arm.directions)
        turn_arm(arm, rotation, hip)
        for i in range(3):
            for j in range(3):
                points[3 * k + i, j] = arm.joints[i, j]


@kernel
def keypoints_of_states(
    states: FloatArray,
    arms_of: FloatArray,
    counts: tuple[bool, bool, bool],
    bones: BonesTuple,
    points: FloatArray,
) -> None:
    """Write the keypoints of N states, (N, 6, 3), metres in the optical frame.

    Joints of parts that do not count (trunk, left arm, right arm) are nan. Shoulders belong to the
    trunk, too; without an arm they are as the arms of ``arms_of``, (N, 14) or (1, 14), raise them.
    """
    parts, girdle, where, tilt = bones
    place, camera = Place(*where), Tilt(*tilt)
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    for n in range(states.shape[0]):
        state_pose(states[n], place, camera, rotation, hip)
        for k in range(2):
            raising = states[n] if counts[1 + k] else arms_of[n if arms_of.shape[0] > 1 else 0]
            angles = angles_in(raising, k)
            pose_arm(angles, side_of(k), parts, girdle, arm.points, arm.directions)
            turn_arm(arm, rotation, hip)
            for i in range(3):
                is_known = counts[1 + k] or (i == 0 and counts[0])
                for j in range(3):
                    points[n, 3 * k + i, j] = arm.joints[i, j] if is_known else np.nan


@inlined_kernel
def angles_of_arm(
    directions: FloatArray, side: float, limits: FloatArray, angles: FloatArray
) -> None:
    """Write an arm's angles (4,) within ``limits`` (4, 2): inverse of :func:`limb_directions`."""
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
def angles_of_arms(directions: FloatArray, side: float, limits: FloatArray) -> FloatArray:
    """Return the angles (N, 4) of arms with ``directions`` (N, 6), within ``limits`` (4, 2)."""
    angles = np.empty((directions.shape[0], 4))
    for i in range(directions.shape[0]):
        angles_of_arm(directions[i], side, limits, angles[i])
    return angles
