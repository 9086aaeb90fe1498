"""Retargeting of single joints by a map from the person's angles to the robot's joints.

    joints:
      - {from: right_shoulder_flexion, to: shoulder_pitch, scale: -1.0, offset_deg: 0.0}
      - {from: right_elbow_bend, to: elbow_pitch}
      - {to: wrist_pitch, offset_deg: 10.0}

Each row sets ``to = scale * from + offset``; the default scale is 1, the default offset 0. A row
without ``from`` keeps a joint at its offset, because a controller may want all joints of an arm.

``left_hand_open`` and ``right_hand_open``, 0 to 1, move grippers where hands are measured. Besides
them and the joints of the posture and of the neck, each arm has two angles as most robot arms have
them, ``SIDE_elbow_bend`` and ``SIDE_upper_arm_turn``: the elbow bends by the first, 0 if the arm is
stretched, and the bent forearm points forwards, or outwards at a turn of a quarter.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.applications.retargeting.robot import Robot
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import foreign
from cardbox_tracker.common.small_yaml import parse_small_yaml, read_small_text
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    LEFT_ARM,
    N_JOINTS,
    RIGHT_ARM,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    HAND_OPEN_NAMES,
    JOINT_NAMES,
    NECK_NAMES,
    Group,
    joints_of,
)

WITH_HEAD_AND_HANDS: tuple[str, ...] = (*JOINT_NAMES, *NECK_NAMES, *HAND_OPEN_NAMES)
"""Order of a posture with head and hands, (16,)."""
_WITH_NECK = len(JOINT_NAMES) + len(NECK_NAMES)
_ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
_ELBOW = {
    f"{side}_{name}": tuple(f"{side}_elbow_{angle}" for angle in ("abduction", "flexion"))
    for side in _ARMS
    for name in ("upper_arm_turn", "elbow_bend")
}
ANGLES: tuple[str, ...] = (*WITH_HEAD_AND_HANDS, *_ELBOW)
"""Names that a joint map may have."""
# The direction of a nearly stretched arm says nothing about its turn.
_LEAST_BEND = math.radians(10.0)
# The head of a robot by names, and the cosine from which on a joint turns about an axis.
_HEAD, _ALONG = re.compile("head|neck", re.IGNORECASE), 0.9
_KEYS = {"from", "to", "scale", "offset_deg"}


def with_head_and_hands(
    posture: FloatArray, stddev: FloatArray, most_stddev_rad: float, hands: FloatArray | None = None
) -> FloatArray:
    """Return a posture with head and hands, (16,), nan where they are not known.

    Posture and deviations are (12,), or (14,) with the neck, rad and m; angles with a deviation
    above ``most_stddev_rad`` are not known. ``hands`` are ``HAND_OPEN_NAMES``, (2,), or nan.
    """
    whole = np.full(len(WITH_HEAD_AND_HANDS), np.nan)
    whole[:N_JOINTS] = posture[:N_JOINTS]
    if len(posture) == len(stddev) == _WITH_NECK:
        sure = stddev[N_JOINTS:] <= most_stddev_rad
        whole[N_JOINTS:_WITH_NECK][sure] = posture[N_JOINTS:][sure]
    if hands is not None:
        whole[_WITH_NECK:] = hands
    return whole


def angles_of(posture: FloatArray) -> dict[str, float]:
    """Return the value of each of ``ANGLES`` in a posture (16,), rad or m; nan if unknown."""
    found = dict(zip(WITH_HEAD_AND_HANDS, posture.tolist(), strict=True))
    for side, arm in _ARMS.items():
        abduction, flexion = posture[arm][[ELBOW_ABDUCTION, ELBOW_FLEXION]].tolist()
        forwards, outwards = math.sin(flexion), math.cos(flexion) * math.sin(abduction)
        down = math.cos(flexion) * math.cos(abduction)
        bend = math.atan2(math.hypot(forwards, outwards), down)
        is_stretched = min(bend, math.pi - bend) < _LEAST_BEND
        turn = math.nan if is_stretched else math.atan2(outwards, forwards)
        found |= {f"{side}_elbow_bend": bend, f"{side}_upper_arm_turn": turn}
    return found


@dataclass(frozen=True)
class JointMap:
    """A :class:`~.retargeter.Method`: each of ``joints`` follows an angle of the person."""

    angles: tuple[str | None, ...]  #: one of ``ANGLES`` for each joint; None for a joint that stays
    joints: tuple[str, ...]  #: the robot's joints without repetition
    scale: FloatArray  #: (n,)
    offset_rad: FloatArray  #: (n,)

    @property
    def roles(self) -> dict[str, str]:
        """What each of the joints follows."""
        return {
            joint: angle or "stays" for joint, angle in zip(self.joints, self.angles, strict=True)
        }

    @property
    def sources(self) -> tuple[tuple[str, ...], ...]:
        """For each joint, those of the posture behind its angle, or the hand; none for the neck."""
        behind = (_ELBOW.get(angle, (angle,)) if angle else () for angle in self.angles)
        known = (*JOINT_NAMES, *HAND_OPEN_NAMES)
        return tuple(tuple(one for one in names if one in known) for names in behind)

    def target(
        self, _: BodyModel, posture: FloatArray, now: FloatArray, begins: bool = False
    ) -> FloatArray:
        """See :class:`~.retargeter.Method`; a joint stays while its angle is unknown."""
        known = angles_of(posture)
        chosen = np.array([known[angle] if angle else 0.0 for angle in self.angles])
        return np.where(np.isnan(chosen), now, self.scale * chosen + self.offset_rad)

    def clear(self, positions: FloatArray, _: FloatArray) -> FloatArray:
        """See :class:`~.retargeter.Method`; nothing is known of the robot's shape."""
        return positions


def head_map(robot: Robot, mount: FloatArray) -> JointMap | None:
    """Return a map of the robot's head: its first joints about Z and Y; None without any.

    They have ``head`` or ``neck`` in their names or those of their links. ``mount`` is the rotation
    matrix (3, 3) from the robot's root to the torso.
    """
    found: dict[str, tuple[str, float]] = {}
    for one in robot.joints.values():
        if one.kind == "prismatic" or not _HEAD.search(f"{one.name} {one.child}"):
            continue
        for joint in joints_of(Group.NECK):
            along = float(mount @ robot.axis_of(one) @ joint.axis)
            if abs(along) > _ALONG:
                found.setdefault(joint.name, (one.name, math.copysign(1.0, along)))
    if not found:
        return None
    joints, signs = zip(*found.values(), strict=True)
    return JointMap(tuple(found), joints, np.array(signs), np.zeros(len(found)))


def load_joint_map(path: str | os.PathLike[str]) -> JointMap:
    """Read a joint map from YAML; raise CardboxError if it cannot be read, or is none."""
    with foreign(path, CardboxError, "a joint map, as the example config/example_joint_map.yaml"):
        rows = parse_small_yaml(read_small_text(path))["joints"]
        if not isinstance(rows, list) or not rows:
            raise ValueError("'joints' is an empty list, or not a list")
        for row in rows:
            if not isinstance(row, dict) or not {"to"} <= set(row) <= _KEYS:
                raise ValueError(
                    f"{quoted(row)} needs 'to', and may have 'from', 'scale' and 'offset_deg'"
                )
            if row.get("from", ANGLES[0]) not in ANGLES:
                raise ValueError(f"{quoted(row['from'])} is not one of {', '.join(ANGLES)}")
        targets = tuple(str(row["to"]) for row in rows)
        if len(set(targets)) < len(targets):
            raise ValueError("a joint of the robot is in two rows")
        scale = np.array([float(row.get("scale", 1.0)) for row in rows])
        offset = np.array([math.radians(float(row.get("offset_deg", 0.0))) for row in rows])
        if not (np.isfinite(scale).all() and np.isfinite(offset).all()):
            raise ValueError("a scale or an offset is not a finite number")
    return JointMap(tuple(row.get("from") for row in rows), targets, scale, offset)
