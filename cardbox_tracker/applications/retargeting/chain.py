"""Finds the arm of a robot: which of its joints follow, which are the gripper, which stay."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.applications.retargeting.robot import Joint, Robot
from cardbox_tracker.common.errors import CardboxError, quoted

_GRIPPER = re.compile(
    r"gripper|jaw|finger|knuckle|thumb|index|middle|ring(?=_|\d|$)|pinky|little|palm", re.IGNORECASE
)
_NO_ARM = re.compile(
    r"leg(?=_|$)|hip|knee|ankle|foot|toe(?=_|$)|head|neck|eye|caster|wheel", re.IGNORECASE
)
_NO_TIP = re.compile(
    r"cam|imu|accel|range|sensor|lidar|optical|screw|collision|contour", re.IGNORECASE
)
_TIPS = ("tcp", "grasp", "gripper_frame", "tool", "ee_", "end_effector", "palm", "hand", "flange")
# A word counts more than a letter, and the first letter of several: L_SHOULDER_R rolls.
_WORDS = re.compile(r"(?<![A-Za-z])(left|right)(?![a-z])", re.IGNORECASE)
_LETTERS = re.compile(r"(?<![A-Za-z])([lLrR])(?![a-z])")
# Several short movable branches of one link are the fingers of a hand, whatever their names.
_LONGEST_FINGER_M = 0.25


@dataclass(frozen=True)
class Arm:
    """A robot's arm."""

    path: tuple[Joint, ...]  #: all joints from the robot's root to the tip
    joints: tuple[str, ...]  #: names of those that follow the person's arm, in this order
    tip: str  #: link of the hand
    gripper: str  #: name of the joint that opens the hand; empty for none
    #: names of the movable joints before the arm and beyond it that do not move
    stays: tuple[str, ...]

    def table(self, robot: Robot, max_speed: float) -> str:
        """Return a text with a row for each joint: name, what it does, limits, speed."""
        roles = dict.fromkeys(self.joints, "arm")
        if self.gripper:
            roles[self.gripper] = "gripper"
        roles |= dict.fromkeys(self.stays, "stays")
        of_path = dict.fromkeys(_names(self.path), "")
        return f"{robot.table(of_path | roles, max_speed)}\nhand: {self.tip}"


def find_arm(robot: Robot, side: str, base: str = "", hand: str = "", gripper: str = "") -> Arm:
    """Return the arm that follows the person's ``side``, by its name one of two arms.

    The arm is the chain of movable joints to its hand without those that another chain shares, such
    as the waist of a humanoid robot, and without the gripper. What is empty is found: the links
    ``base``, at which the arm begins, and ``hand``, and the joint ``gripper``. Raises CardboxError
    if there is no such link or joint, or several arms remain.
    """
    ends = _ends(robot, _fingers(robot))
    path = robot.path(hand) if hand else _chosen(robot, ends, side)
    used = _names(path)
    if base:
        if not path or base not in (path[0].parent, *(one.child for one in path)):
            raise CardboxError(f"the robot's link {quoted(base)} is not before the hand")
        shared = set(_names(robot.path(base)))
    else:
        others = [set(_names(robot.path(end))) for end in ends]
        shared = {name for one in others if one - set(used) and set(used) - one for name in one}
    joints = tuple(name for name in used if name not in shared)
    last = robot.joints[joints[-1]].child if joints else ""
    tip = hand or _tip(robot, last)
    if len(joints) < 2:
        raise CardboxError(
            f"the arm to {tip or hand or 'the hand'} has {len(joints)} joints of its own; "
            "expected at least 2: give the links of its base and its hand; "
            f"movable joints: {', '.join(used)}"
        )
    beyond_arm = [
        one.name
        for one in robot.joints.values()
        if one.name not in used and any(step.child == last for step in robot.path(one.child))
    ]
    if gripper:
        robot.limits_of((gripper,))
    elif len(beyond_arm) == 1:
        gripper = beyond_arm[0]
    stays = [name for name in (*used, *beyond_arm) if name not in (*joints, gripper)]
    return Arm(robot.path(tip), joints, tip, gripper, tuple(stays))


def _names(path: Iterable[Joint]) -> tuple[str, ...]:
    return tuple(one.name for one in path if one.moves)


def _fingers(robot: Robot) -> set[str]:
    roots = {name for name, one in robot.joints.items() if _GRIPPER.search(name)}
    branches: dict[frozenset[str], list[Joint]] = {}
    for one in robot.joints.values():
        branches.setdefault(frozenset(_rigid(robot, one.parent)), []).append(one)
    for several in branches.values():
        is_hand = len(several) > 1 and len(_names(robot.path(several[0].parent))) > 1
        if is_hand and all(_length(robot, one.child) < _LONGEST_FINGER_M for one in several):
            roots |= {one.name for one in several}
    # A joint with nothing beyond it that fingers beside it mimic moves them.
    carries = {one.parent for one in robot.all_joints.values() if one.kind != "fixed"}
    for one in robot.all_joints.values():
        leader = robot.joints.get(one.mimics)
        is_last = leader is not None and not carries & _rigid(robot, leader.child)
        if leader is not None and is_last and one.parent in _rigid(robot, leader.parent):
            roots.add(leader.name)
    return {
        one.child
        for one in robot.joints.values()
        if any(step.name in roots for step in robot.path(one.child))
    }


def _rigid(robot: Robot, link: str) -> set[str]:
    """Return the links that never move relative to ``link``."""
    while link in robot.all_joints and not robot.all_joints[link].moves:
        link = robot.all_joints[link].parent
    found, more = set(), {link}
    while more:
        found |= more
        more = {
            one.child for one in robot.all_joints.values() if one.parent in more and not one.moves
        }
    return found


def _length(robot: Robot, link: str) -> float:
    return max(
        (
            float(np.linalg.norm(one.origin_m)) + _length(robot, one.child)
            for one in robot.all_joints.values()
            if one.parent == link
        ),
        default=0.0,
    )


def _ends(robot: Robot, fingers: set[str]) -> list[str]:
    """Return the last moving link of each chain that is no finger."""
    moved = [one.child for one in robot.joints.values() if one.child not in fingers]
    before = {step.child for link in moved for step in robot.path(link)[:-1]}
    return [link for link in moved if link not in before]


def _chosen(robot: Robot, ends: list[str], side: str) -> tuple[Joint, ...]:
    """Return the path to the last moving link of the arm."""
    paths = [robot.path(end) for end in ends]
    counts: dict[str, int] = {}
    for path in paths:
        for name in _names(path):
            counts[name] = counts.get(name, 0) + 1
    arms = []
    for path in paths:
        own = [one for one in path if one.moves and counts[one.name] == 1]
        if len(own) > 1 and not any(_NO_ARM.search(one.name) for one in own):
            arms.append((path, own))
    if len(arms) > 1:
        found = [(path, own) for path, own in arms if all(_side_of(one) == side for one in own)]
        if len(found) != 1:
            hands = ", ".join(_tip(robot, path[-1].child) for path, _ in arms)
            raise CardboxError(
                f"the robot has {len(arms)} arms, and their names do not tell which one is the "
                f"{side} one; give its hand (--hand), which may be one of {hands}"
            )
        arms = found
    if not arms:
        raise CardboxError(
            "the robot has no chain of two joints that may be an arm; give its hand (--hand), "
            f"one of {', '.join(robot.all_joints)}"
        )
    return arms[0][0]


def _side_of(joint: Joint) -> str:
    """Return ``left`` or ``right`` by the name of a joint, or of its link, or an empty text."""
    for pattern in (_WORDS, _LETTERS):
        for name in (joint.name, joint.child):
            if found := pattern.search(name):
                return "left" if found[1].lower().startswith("l") else "right"
    return ""


def _tip(robot: Robot, link: str) -> str:
    """Return the frame of the hand that is fixed to the last moving link, or that link."""
    fixed = [one for one in sorted(_rigid(robot, link) - {link}) if not _NO_TIP.search(one)]
    for word in _TIPS:
        named = [one for one in fixed if word in one.lower()]
        if named:
            return max(named, key=lambda one: len(robot.path(one)))
    return max(fixed, key=lambda one: len(robot.path(one)), default=link)
