"""Converts postures to the joints of REP-155, the ROS convention for people around robots.

The reference model (package human_description) has three joints in a shoulder and one in an elbow.
With s = 1 on the left and -1 on the right,

    R_upper_arm = R_torso Rz(-s y) Rx(s p) Rz(s r),    R_forearm = R_upper_arm Ry(-e)

so p raises the arm, y gives the direction (0: outwards, 90 degrees: forwards), r turns the upper
arm about its own axis and e bends the elbow. If the arm hangs (p = 0), y is undefined; if
it is straight (e = 0), r is undefined; at rest both are. Also, two pairs of angles describe each
direction: (y, p) and (y + 180 degrees, -p), likewise (r, e). If the positive values were always
taken, the joints would jump by half a turn when an arm swings through rest. :class:`Rep155Joints`
therefore remembers the last angles and takes the nearer pair; an undefined angle keeps its value.

The joint ``waist`` is our ``torso_pitch``. The reference model has no other joint of the spine;
``body``, ``y_waist`` and ``r_waist`` are added for the position, the turn and the sideways bend, so
that ``body`` is the middle of the hips, in the sensor's frame.

The joint ``y_head`` is our ``neck_yaw``. ``p_head`` is our ``neck_pitch`` with the other sign: it
is positive if the face looks up. The reference model's third joint of the head, ``r_head``, is
missing.

Further joints of ours are ``x_body`` and ``z_body``, which lead to ``body`` and are ``torso_x`` and
``torso_z``, and ``l_clavicle`` and ``r_clavicle``, which raise the shoulders. Without the first two
the frame ``body_<id>``, which others take for the person's place, would stay at the distance and
height at which the person was measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from cardbox_tracker.person.parts import BodyParts
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    FIXED,
    POSTURE_GROUPS,
    SKELETON,
    Group,
    Joint,
    Offset,
    Point,
    X,
    arm_rotations,
    joints_of,
    names_of,
    rotation_x,
    rotation_z,
)

LOWEST_RAISE_RAD = -math.pi / 3
"""Lowest p: an arm that swings further through rest gets its other pair of angles, rad."""
LOWEST_BEND_RAD = -math.pi / 6
"""Lowest e of the elbow, which REP-155 bends in one direction only, rad."""
_FULL = (-2 * math.pi, 2 * math.pi)

_GROUPS = (*POSTURE_GROUPS, Group.PLACE, Group.NECK, Group.CLAVICLE)
_PITCH = names_of(*_GROUPS).index("neck_pitch")

# Nearer than this to the singular direction the other angle is kept.
_MEANINGLESS_RAD = 1e-3


def joint_names(body_id: str, torso_place: bool = True) -> list[str]:
    """Return the names of the joints of ``body_id``: 12, or 18 with place, head and clavicles."""
    groups = _GROUPS if torso_place else POSTURE_GROUPS
    return [f"{joint.rep155}_{body_id}" for joint in joints_of(*groups)]


def rep155_skeleton() -> Iterator[Joint]:
    """Yield the joints of the skeleton with the names, axes and limits of REP-155.

    They have no ending. The parts of the upper body hang on ``torso``, a frame between the
    shoulders.
    """
    skeleton = [joint for joint in SKELETON if joint.group in (*_GROUPS, Group.END)]
    names, joints = {joint.name: joint.rep155 for joint in skeleton}, joints_of(*_GROUPS)
    lowest, highest = joints[_PITCH].limits
    changed: dict[str, dict[str, Any]] = {
        joints[_PITCH].name: {"axis": (0.0, -1.0, 0.0), "limits": (-highest, -lowest)}
    }
    for arm, letter, side in ((joints[LEFT_ARM], "l", 1.0), (joints[RIGHT_ARM], "r", -1.0)):
        (first, second, third, fourth), elbow = (joint.name for joint in arm), arm[2].offset
        raise_, bend = (LOWEST_RAISE_RAD, math.pi), (LOWEST_BEND_RAD, math.pi)
        changed[first] = {"axis": (0.0, 0.0, -side), "limits": _FULL}
        changed[second] = {"axis": (side, 0.0, 0.0), "limits": raise_}
        changed[third] = {"axis": (0.0, 0.0, side), "limits": _FULL, "offset": arm[0].offset}
        changed[third]["moves"] = f"{letter}_shoulder"
        changed[fourth] = {"limits": bend, "offset": elbow}
    fixed = Group.END, "r_waist", FIXED, X, (0.0, 0.0)
    yield Joint(
        *("torso", *fixed, "torso", "torso"), lambda parts: (0.0, 0.0, parts.shoulder_height_m)
    )
    for joint in skeleton:
        name = joint.rep155
        row = joint._replace(name=name, parent=names.get(joint.parent, ""), moves=name)
        if joint.parent == "torso_roll":
            row = row._replace(parent="torso", offset=_from_shoulders(joint))
        yield row._replace(**changed.get(joint.name, {}))


def _from_shoulders(joint: Joint) -> Offset:
    def offset(parts: BodyParts[float]) -> Point:
        x, y, z = joint.offset(parts)
        return x, y, z - parts.shoulder_height_m

    return offset


class Rep155Joints:
    """Converts the postures of one person in order of time."""

    def __init__(self) -> None:
        """Start with all angles 0."""
        self._last = {1.0: np.zeros(4), -1.0: np.zeros(4)}

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the joints of :func:`joint_names`, rad and metres, of our joints in that order.

        They are a posture (12,), or begin with one.
        """
        found = np.array(values)
        for arm, side in ((LEFT_ARM, 1.0), (RIGHT_ARM, -1.0)):
            found[arm] = self._arm(found[arm], side)
        found[_PITCH : _PITCH + 1] *= -1.0
        return found

    def _arm(self, angles: FloatArray, side: float) -> FloatArray:
        upper_arm, forearm = arm_rotations(angles, side)
        last = self._last[side]
        # Directions of the limbs, mirrored to the left side.
        mirror = np.array([1.0, side, 1.0])
        upper, lower = -upper_arm[:, 2] * mirror, -forearm[:, 2] * mirror
        # upper = (sin y sin p, cos y sin p, -cos p)
        y, p = _angles(upper[0], upper[1], -upper[2], last[0], last[1], LOWEST_RAISE_RAD)
        # In the frame after y and p: lower = (cos r sin e, sin r sin e, -cos e)
        lower = rotation_x(np.array(-p)) @ rotation_z(np.array(y)) @ lower
        r, e = _angles(lower[1], lower[0], -lower[2], last[2], last[3], LOWEST_BEND_RAD)
        self._last[side] = np.array([y, p, r, e])
        return self._last[side]


def _angles(
    sine: float, cosine: float, up: float, last_turn: float, last_tilt: float, lowest: float
) -> tuple[float, float]:
    """Return turn and tilt for (sine, cosine, up), near the last ones and not below ``lowest``."""
    tilt = float(np.arctan2(np.hypot(sine, cosine), up))
    sign = 1.0 if last_tilt >= 0 else -1.0
    if min(tilt, np.pi - tilt) < _MEANINGLESS_RAD and sign * tilt >= lowest:
        return last_turn, sign * tilt
    turn = float(np.arctan2(sine, cosine))
    pairs = [(_near(turn, last_turn), tilt), (_near(turn + np.pi, last_turn), -tilt)]
    allowed = [pair for pair in pairs if pair[1] >= lowest]
    return min(allowed, key=lambda pair: abs(pair[0] - last_turn))


def _near(angle: float, last: float) -> float:
    """Return ``angle`` plus the whole turns that bring it nearest to ``last``, within two turns."""
    near = last + np.remainder(angle - last + np.pi, 2 * np.pi) - np.pi
    return float(near if abs(near) <= 2 * np.pi else np.remainder(near + np.pi, 2 * np.pi) - np.pi)
