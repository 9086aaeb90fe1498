"""The skeleton as a table: a row is a joint, and everything that names joints follows from it.

A row says where a joint is, what it moves, how far and about which axis, and what it is called.
From the rows come names and limits of postures (:mod:`.posture`), the robot
descriptions (:mod:`.urdf`), joint states and the columns of tables. Only the kernels of
:mod:`.kinematics` are written by hand, for speed; the robot descriptions, which are not, must agree
with them.

The rest posture (upright, arms hanging) is all zero. The signs are those of a right-handed rotation
about the axis: a positive roll leans to the person's right, a positive pitch forward, a positive
yaw turns to their left. For either arm a positive abduction raises it outwards, a positive flexion
forwards. The face turns and nods as the torso does.

The ranges are those of the American Academy of Orthopaedic Surgeons, "Joint Motion: Method of
Measuring and Recording", 1965 (reprinted in Norkin & White, "Measurement of Joint Motion"), in
degrees: thoraco-lumbar lateral flexion 35, flexion 80, extension 25, rotation 45; hip flexion 120,
abduction 45, rotation 45; shoulder abduction 180, flexion 180, extension 60, horizontal adduction
45; elbow flexion 150, none backwards (10 are allowed for a straight arm); neck rotation 80, flexion
and extension 45.

The torso reaches from the hips to the neck, so the ranges of hips and spine add up, rounded down to
the range of a standing person; who walks or looks aside also turns with the feet. The two angles of
a limb reach every direction twice: flexion beyond 90 degrees equals less flexion with the abduction
turned by half a circle. Flexion therefore ends at about 90 degrees, and abduction covers the rest.
A forearm can point to either side, since the upper arm does not turn about its axis. The upper
back, which is a part of the torso here, bends with the neck.

**Hands.** A hand turns about the forearm, bends to its palm, then to the little finger:

    R_palm = R_forearm Rz(-+turn) Rx(-+flexion) Ry(deviation)

with the upper sign for the left hand. All is zero if the palm of a hanging arm faces the body. The
turn is against the frame of the forearm, so it is known for a straight arm, too, and can have any
value. The ranges are flexion 80, extension 70, deviation to the thumb 20 and to the little finger
30 degrees, with 20 degrees more for errors of the measurement.

**Clavicles.** The girdle raises the shoulder of a raised arm. A shoulder joint then moves along a
straight line, upwards and a little inwards, by ``shoulder_rise`` times the shoulder breadth for
each radian of the upper arm's elevation beyond ``RISE_FROM_RAD``. The arm's angles stay those
between arm and torso. Clavicle and shoulder blade contribute about a third of an arm's elevation
(Inman, Saunders & Abbott, "Observations on the Function of the Shoulder Joint", 1944), and a part
of it moves the joint: the rise was fitted to motion capture. The line is within 3 mm of a clavicle
that turns about its inner end. In the paper the shoulders are rigid: their rise is 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import cache, reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.parts import BodyParts
from cardbox_tracker.person.proportions import (
    HIP_SHARE,
    SHANK_SHARE,
    THIGH_SHARE,
    WRIST_SHARE,
    stature_of,
)
from cardbox_tracker.person.sizes import FloatArray

Point = tuple[float, float, float]
Offset = Callable[[BodyParts[float]], Point]

PRISMATIC, REVOLUTE, FIXED = "prismatic", "revolute", "fixed"
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_BACK_Y, _DOWN = (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)


class Group(StrEnum):
    """What a joint belongs to, and what its values come from."""

    TORSO = "torso"  #: searched
    ARM = "arm"  #: searched
    PLACE = "place"  #: searched, but constant in the paper
    NECK = "neck"  #: from points of the face
    CLAVICLE = "clavicle"  #: from the arms, which they follow
    END = "end"  #: fixed frames at the ends of neck and arms
    HAND = "hand"  #: from points of the hands, for people whose hands are measured
    LEG = "leg"  #: from points of the legs


POSTURE_GROUPS = Group.TORSO, Group.ARM
"""Groups of a posture, d1..d12 (paper, equation (3))."""

SHOULDER_RISE = 0.077
"""Rise of a shoulder joint per radian of elevation of its arm, in shoulder breadths."""
RISE_FROM_RAD = math.radians(30.0)
"""Elevation of the upper arm above which its shoulder rises."""
RISE_INWARDS, RISE_UPWARDS = math.sin(0.2), math.cos(0.2)
"""Direction of the rise: to the middle of the body, and up, in the torso's frame."""


def _at_parent(_: BodyParts[float]) -> Point:
    return (0.0, 0.0, 0.0)


class Joint(NamedTuple):
    """A joint; the first values are those of the frame that its parent moves, at rest."""

    name: str  #: its name in joint states and tables
    group: Group  #: what it belongs to
    parent: str  #: name of the joint that carries it; empty for the middle of the hips as measured
    kind: str  #: ``prismatic`` (metres), ``revolute`` (rad) or ``fixed``
    axis: Point  #: unit vector
    #: lowest and highest value; those of ``torso_x`` depend on the person's distance.
    limits: tuple[float, float]
    rep155: str  #: its name in REP-155, without the body's id (:mod:`.rep155`)
    moves: str = ""  #: name of what it moves; empty for an intermediate frame
    offset: Offset = _at_parent  #: function of the body's parts that returns its place, metres

    @property
    def link(self) -> str:
        """Name of the link that it moves, in the robot description."""
        return self.moves or f"{self.name}_link"

    @property
    def unit(self) -> str:
        """Unit of its values, ``m`` or ``rad``."""
        return "m" if self.kind == PRISMATIC else "rad"

    @property
    def side(self) -> str:
        """``left`` or ``right``; empty for the middle of the body."""
        side = self.name.partition("_")[0]
        return side if side in ("left", "right") else ""

    @property
    def any_stddev(self) -> float:
        """Standard deviation, m or rad, of a value that is somewhere in its range."""
        return (self.limits[1] - self.limits[0]) / math.sqrt(12.0)


def _deg(lowest: float, highest: float) -> tuple[float, float]:
    return math.radians(lowest), math.radians(highest)


def neck_pivot_m(parts: BodyParts[float]) -> Point:
    """Return the joint of the head, the middle of the neck, in the torso's frame, metres."""
    return parts.neck.forward_m, 0.0, parts.neck.middle_m


def head_from_pivot_m(parts: BodyParts[float]) -> Point:
    """Return the middle of the head, metres, in the head's axes from :func:`neck_pivot_m`."""
    x, _, z = neck_pivot_m(parts)
    return parts.head.forward_m - x, 0.0, parts.head.middle_m - z


_NO_RANGE = 0.0, 0.0
# Joints of one side, without its name; the directions are those of the left side.
_LIMBS: tuple[Joint, ...] = (
    Joint(
        *("shoulder_abduction", Group.ARM, "clavicle_elevation", REVOLUTE),
        *(X, _deg(-45, 180), "y_shoulder", "shoulder_link"),
    ),
    Joint(
        *("shoulder_flexion", Group.ARM, "shoulder_abduction", REVOLUTE),
        *(_BACK_Y, _deg(-60, 90), "p_shoulder", "upper_arm"),
    ),
    Joint(
        *("elbow_abduction", Group.ARM, "shoulder_flexion", REVOLUTE),
        *(X, _deg(-150, 150), "r_shoulder", "elbow_link"),
        lambda parts: (0.0, 0.0, parts.upper_arm.bottom_m),
    ),
    Joint(
        *("elbow_flexion", Group.ARM, "elbow_abduction", REVOLUTE),
        *(_BACK_Y, _deg(-10, 95), "elbow", "forearm"),
    ),
    Joint(
        *("clavicle_elevation", Group.CLAVICLE, "torso_roll", PRISMATIC),
        *((0.0, -RISE_INWARDS, RISE_UPWARDS), (0.0, 0.15), "clavicle", "clavicle"),
        lambda parts: (0.0, parts.shoulder_aside_m, parts.shoulder_height_m),
    ),
    Joint(
        *("wrist", Group.END, "elbow_flexion", FIXED, X, _NO_RANGE, "wrist", "hand"),
        lambda parts: (0.0, 0.0, parts.forearm.bottom_m),
    ),
    Joint(
        *("forearm_turn", Group.HAND, "elbow_flexion", REVOLUTE),
        *(_DOWN, _deg(-180, 180), "y_wrist"),
    ),
    Joint(
        *("wrist_flexion", Group.HAND, "forearm_turn", REVOLUTE),
        *((-1.0, 0.0, 0.0), _deg(-90, 100), "r_wrist", ""),
        lambda parts: (0.0, 0.0, WRIST_SHARE * parts.forearm.bottom_m),
    ),
    Joint(
        *("wrist_deviation", Group.HAND, "wrist_flexion", REVOLUTE),
        *(Y, _deg(-40, 50), "p_wrist", "palm"),
    ),
    Joint(
        *("hip_flexion", Group.LEG, "torso_yaw", REVOLUTE, _BACK_Y, _deg(-40, 125), "p_hip", ""),
        lambda parts: (0.0, HIP_SHARE * stature_of(parts), 0.0),
    ),
    Joint("hip_abduction", Group.LEG, "hip_flexion", REVOLUTE, X, _deg(-35, 65), "r_hip"),
    Joint(
        *("hip_rotation", Group.LEG, "hip_abduction", REVOLUTE),
        *(_DOWN, _deg(-50, 50), "y_hip", "thigh"),
    ),
    Joint(
        *("knee_flexion", Group.LEG, "hip_rotation", REVOLUTE, Y, _deg(0, 150), "knee", "shank"),
        lambda parts: (0.0, 0.0, -THIGH_SHARE * stature_of(parts)),
    ),
    Joint(
        *("ankle", Group.LEG, "knee_flexion", FIXED, X, _NO_RANGE, "ankle", "foot"),
        lambda parts: (0.0, 0.0, -SHANK_SHARE * stature_of(parts)),
    ),
)


def _limbs(group: Group) -> Iterator[Joint]:
    """Yield the joints of a group on both sides; the right ones mirror the left ones."""
    for name, side in (("left", 1.0), ("right", -1.0)):
        for joint in _LIMBS:
            if joint.group == group:
                yield _of_side(joint, name, side)


def _of_side(joint: Joint, name: str, side: float) -> Joint:
    x, y, z = joint.axis
    turned = joint.kind != PRISMATIC

    def offset(parts: BodyParts[float]) -> Point:
        ahead_m, aside_m, up_m = joint.offset(parts)
        return ahead_m, side * aside_m, up_m

    return joint._replace(
        name=f"{name}_{joint.name}",
        parent=joint.parent if joint.parent.startswith("torso") else f"{name}_{joint.parent}",
        # The mirror image of a turn about Y is itself, and that of a motion along X and Z.
        axis=(side * x, y, side * z) if turned else (x, side * y, z),
        rep155=f"{name[0]}_{joint.rep155}",
        moves=joint.moves and f"{name}_{joint.moves}",
        offset=offset,
    )


SKELETON: tuple[Joint, ...] = (
    Joint("torso_y", Group.TORSO, "torso_z", PRISMATIC, Y, (-3.0, 3.0), "body"),
    Joint("torso_roll", Group.TORSO, "torso_pitch", REVOLUTE, X, _deg(-45, 45), "r_waist", "torso"),
    Joint("torso_pitch", Group.TORSO, "torso_yaw", REVOLUTE, Y, _deg(-25, 100), "waist"),
    Joint("torso_yaw", Group.TORSO, "torso_y", REVOLUTE, Z, _deg(-280, 280), "y_waist"),
    *_limbs(Group.ARM),
    Joint("torso_x", Group.PLACE, "", PRISMATIC, X, (-math.inf, math.inf), "x_body"),
    # Between sitting on a low stool and standing on tiptoe.
    Joint("torso_z", Group.PLACE, "torso_x", PRISMATIC, Z, (-0.6, 0.3), "z_body"),
    Joint(
        *("neck_yaw", Group.NECK, "torso_roll", REVOLUTE, Z, _deg(-80, 80), "y_head", ""),
        neck_pivot_m,
    ),
    Joint("neck_pitch", Group.NECK, "neck_yaw", REVOLUTE, Y, _deg(-60, 60), "p_head"),
    *_limbs(Group.CLAVICLE),
    Joint("neck", Group.END, "neck_pitch", FIXED, X, _NO_RANGE, "head", "head", head_from_pivot_m),
    *_limbs(Group.END),
    *_limbs(Group.HAND),
    *_limbs(Group.LEG),
)
"""All joints; the movable ones in the order of joint states, to which new ones are appended."""


@cache
def joints_of(*groups: Group, side: str = "") -> tuple[Joint, ...]:
    """Return the movable joints of some groups, or of one side of them, in the table's order."""
    return tuple(
        joint
        for joint in SKELETON
        if joint.kind != FIXED and joint.group in groups and side in ("", joint.side)
    )


@cache
def names_of(*groups: Group, side: str = "") -> tuple[str, ...]:
    """Return the names of :func:`joints_of`."""
    return tuple(joint.name for joint in joints_of(*groups, side=side))


STATE = joints_of(*Group)
"""All movable joints: those of the state of a person, in the order of ``joint_states``."""
STATE_NAMES = names_of(*Group)


@cache
def rows_of(*groups: Group, side: str = "") -> NDArray[np.intp]:
    """Return the indices (n,) of :func:`joints_of` in ``STATE``; not writable."""
    rows = np.array([STATE.index(joint) for joint in joints_of(*groups, side=side)], np.intp)
    rows.setflags(write=False)
    return rows


JOINT_NAMES = names_of(*POSTURE_GROUPS)
"""The 12 joints of a posture, d1..d12 (paper, equation (3))."""
PLACE_NAMES = names_of(Group.PLACE)
"""How far the hips are nearer to the camera, and higher, than where they were measured, metres."""
NECK_NAMES = names_of(Group.NECK)
HAND_NAMES = names_of(Group.HAND)
"""The 6 joints of the hands, three of the left one first; all are in rad."""
HAND_OPEN_NAMES = "left_hand_open", "right_hand_open"
"""How open the hands are, 0 to 1."""
LEG_NAMES = names_of(Group.LEG)
"""The 8 joints of the legs, four of the left one first; all are in rad."""
UNITS = {joint.name: joint.unit for joint in SKELETON}
"""Unit of each joint by its name, ``m`` or ``rad``."""


@cache
def limits_of(*groups: Group, side: str = "") -> FloatArray:
    """Return lowest and highest value, (n, 2), rad or m, of :func:`joints_of`; not writable."""
    limits: FloatArray = np.array([joint.limits for joint in joints_of(*groups, side=side)])
    limits.setflags(write=False)
    return limits


NECK_LIMITS = limits_of(Group.NECK)
LEG_LIMITS = limits_of(Group.LEG)

KEYPOINT_NAMES: tuple[str, ...] = (
    *("left_shoulder", "left_elbow", "left_hand"),
    *("right_shoulder", "right_elbow", "right_hand"),
)
SHOULDERS = 0, 3
"""Their places among the keypoints."""
POINT_NAMES: tuple[str, ...] = ("hip", "neck", "head", *KEYPOINT_NAMES)
"""Points of :func:`.kinematics.pose`: the middle of the hips, the middle of the torso's top, the
middle of the head, then the keypoints."""
FRAME_NAMES: tuple[str, ...] = (
    *("torso", "left_upper_arm", "left_forearm", "right_upper_arm", "right_forearm"),
)
"""Parts whose rotations :func:`.kinematics.pose` returns."""


class KeypointState(StrEnum):
    """Whether a keypoint can be relied upon."""

    TRACKED = "tracked"
    UNCERTAIN = "uncertain"
    HIDDEN = "hidden"
    LOST = "lost"


def rotation_x(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about X by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 1, 2)


def rotation_y(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about Y by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 2, 0)


def rotation_z(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about Z by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 0, 1)


def _rotation(angle_rad: FloatArray, i: int, j: int) -> FloatArray:
    """Return the rotation in the plane of axes ``i`` and ``j`` that turns ``i`` towards ``j``."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., 3 - i - j, 3 - i - j] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., j, i] = np.sin(angle)
    matrix[..., i, j] = -matrix[..., j, i]
    return matrix


def turn_of(palm: FloatArray, forearm: FloatArray, side: float) -> float:
    """Return the turn of a hand about its forearm, rad.

    ``palm`` (3,) is the normal out of the palm, ``forearm`` (3, 3) the rotation of its frame in the
    same axes; ``side`` is +1 for the left hand, -1 for the right.
    """
    x, y, _ = forearm.T @ palm
    return -side * math.atan2(side * float(x), -side * float(y))


def neck_rotation(angles_rad: FloatArray) -> FloatArray:
    """Return the rotations (..., 3, 3) from head to torso at angles (..., n) of the neck."""
    angles = np.moveaxis(np.asarray(angles_rad, dtype=np.float64), -1, 0)
    about = {X: rotation_x, Y: rotation_y, Z: rotation_z}
    turns = zip(joints_of(Group.NECK), angles, strict=True)
    return reduce(np.matmul, [about[joint.axis](angle) for joint, angle in turns])


def arm_rotations(angles_rad: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Return rotations (..., 3, 3) from upper arm and forearm, which hang along -Z, to torso.

    The four angles of an arm are (..., 4), rad; ``side`` is +1 for the left arm, -1 for the right.
    """
    a = np.asarray(angles_rad, dtype=np.float64)
    upper_arm = rotation_x(side * a[..., 0]) @ rotation_y(-a[..., 1])
    return upper_arm, upper_arm @ rotation_x(side * a[..., 2]) @ rotation_y(-a[..., 3])


def arm_directions(angles_rad: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (..., 3) along upper arm and forearm; see :func:`arm_rotations`."""
    upper_arm, forearm = arm_rotations(angles_rad, side)
    return -upper_arm[..., 2], -forearm[..., 2]
