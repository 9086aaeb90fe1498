"""``cardbox retarget``: robot commands for a bag of results, as a CSV file and as a bag."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.files import write_table
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.retargeting.retargeter import Command, Retargeter

SPACE = "/retarget"
"""Namespace of the robot's topics in the bag, equal to the node's."""


class StampedCommand(NamedTuple):
    """A command and the stamp of its image."""

    stamp_ns: int
    command: Command


def retarget_bag(bag: BagReader, retargeter: Retargeter) -> list[StampedCommand]:
    """Return the command for each image of a bag of results.

    Raises:
        BagError: the bag has no results of the tracker, or is damaged.
    """
    return [
        StampedCommand(found.stamp_ns, retargeter.update(*found)) for found in read_results(bag)
    ]


def write_csv(commands: Sequence[StampedCommand], joints: Sequence[str], path: Path) -> None:
    """Write a row with stamp, ns, status and joint positions (rad or m) for each image.

    Raises:
        CardboxError: the file cannot be written.
    """
    rows = (
        (str(stamp_ns), command.status, *(f"{value:.6f}" for value in command.positions))
        for stamp_ns, command in commands
    )
    write_table(path, ("stamp_ns", "status", *joints), rows)


def write_bag(
    bag: BagReader,
    commands: Sequence[StampedCommand],
    joints: Sequence[str],
    urdf: str,
    path: Path,
    overwrite: bool = False,
) -> None:
    """Write the results together with the topics that the node ``retarget`` publishes.

    Raises:
        BagError: ``path`` exists and may not be replaced.
    """
    latched = [topic for topic in bag.topics if topic.endswith(("_model", "_description"))]
    description = f"{SPACE}/robot_description"
    with BagWriter(path, "mcap", overwrite, compress=True, latched=[*latched, description]) as out:
        for message in bag.messages():
            with suppress(KeyError):  # the type is not part of ROS 2
                out.type(message.msgtype)
                out.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        if commands:
            out.write_string(description, commands[0].stamp_ns, urdf)
        for stamp_ns, command in commands:
            _write_command(out, stamp_ns, command, joints)


def _write_command(bag: BagWriter, stamp_ns: int, command: Command, joints: Sequence[str]) -> None:
    positions, names = command.positions, list(joints)
    bag.write_string(f"{SPACE}/status", stamp_ns, command.status)
    bag.write_joint_state(f"{SPACE}/joint_states", stamp_ns, "", names, positions)
    duration_ns = round(command.duration_s * 1e9)
    duration = bag.type("builtin_interfaces/msg/Duration")
    point = bag.type("trajectory_msgs/msg/JointTrajectoryPoint")(
        positions=positions,
        velocities=positions[:0],
        accelerations=positions[:0],
        effort=positions[:0],
        time_from_start=duration(sec=duration_ns // 10**9, nanosec=duration_ns % 10**9),
    )
    trajectory = bag.type("trajectory_msgs/msg/JointTrajectory")
    # A controller starts a trajectory with the stamp 0 at once.
    message = trajectory(header=bag.header(0, ""), joint_names=names, points=[point])
    bag.write(f"{SPACE}/joint_trajectory", message, stamp_ns)
