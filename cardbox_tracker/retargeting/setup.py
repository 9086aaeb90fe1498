"""Construction of a retargeter from a robot's URDF and a joint map or hand link."""

from __future__ import annotations

import os

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.retargeting.config import RetargetConfig
from cardbox_tracker.retargeting.hand import HandFollower
from cardbox_tracker.retargeting.joint_map import load_joint_map
from cardbox_tracker.retargeting.retargeter import Method, Retargeter
from cardbox_tracker.retargeting.robot import Robot, load_robot


def make_retargeter(
    robot_file: str | os.PathLike[str],
    joint_map: str | os.PathLike[str] | None,
    hand_link: str,
    config: RetargetConfig,
) -> tuple[Robot, Retargeter]:
    """Return a robot and its retargeter.

    Args:
        robot_file: URDF of the robot.
        joint_map: file of a joint map; if None, the hand is followed by inverse kinematics.
        hand_link: link of the robot's hand; if empty, the link with the longest joint chain.
        config: settings.

    Raises:
        CardboxError: a file cannot be read, the robot lacks a joint or link, or the libraries for
            inverse kinematics are not installed.
    """
    robot = load_robot(robot_file)
    method: Method
    if joint_map:
        if hand_link:
            raise CardboxError("expected either a joint map or a hand, not both")
        method = load_joint_map(joint_map)
    else:
        method = HandFollower(robot, config, hand_link)
    return robot, Retargeter(robot, method, config)
