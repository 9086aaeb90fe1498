"""``cardbox retarget``: a robot follows the results in a bag; a table, and a bag to look at."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.files import stamp_text, write_table
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.retargeting.retargeter import Command, Retargeter

SPACE = "/retarget"
"""Namespace of the robot in the bag, as of the node."""


class Step(NamedTuple):
    """A command, and the stamp of its image."""

    stamp_ns: int
    command: Command


def retarget_bag(bag: BagReader, retargeter: Retargeter) -> list[Step]:
    """Return the command of every image of a bag of results.

    Raises:
        BagError: the bag has no results of the tracker, or is damaged.
    """
    return [Step(found.stamp_ns, retargeter.update(*found)) for found in read_results(bag)]


def write_csv(steps: Sequence[Step], joints: Sequence[str], path: Path) -> None:
    """Write stamp, status and the joints' positions (rad or m) of each image.

    Raises:
        CardboxError: the file cannot be written.
    """
    rows = (
        (stamp_text(stamp_ns), command.status, *(f"{value:.6f}" for value in command.positions))
        for stamp_ns, command in steps
    )
    write_table(path, ("stamp", "status", *joints), rows)


def write_bag(
    bag: BagReader,
    steps: Sequence[Step],
    joints: Sequence[str],
    urdf: str,
    path: Path,
    overwrite: bool = False,
) -> None:
    """Write the results with what the node ``retarget`` would have published beside them.

    Raises:
        BagError: something is in the way.
    """
    latched = [topic for topic in bag.topics if topic.endswith(("_model", "_description"))]
    description = f"{SPACE}/robot_description"
    with BagWriter(path, "mcap", overwrite, compress=True, latched=[*latched, description]) as out:
        for message in bag.messages():
            with suppress(KeyError):  # a type that is not part of ROS 2
                out.type(message.msgtype)
                out.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        if steps:
            out.write_string(description, steps[0].stamp_ns, urdf)
        for stamp_ns, command in steps:
            _write_command(out, stamp_ns, command, joints)


def _write_command(bag: BagWriter, stamp_ns: int, command: Command, joints: Sequence[str]) -> None:
    positions, names = command.positions, list(joints)
    bag.write_string(f"{SPACE}/status", stamp_ns, command.status)
    bag.write_joint_state(f"{SPACE}/joint_states", stamp_ns, "", names, positions)
    later_ns = round(command.duration_s * 1e9)
    duration = bag.type("builtin_interfaces/msg/Duration")
    point = bag.type("trajectory_msgs/msg/JointTrajectoryPoint")(
        positions=positions,
        velocities=positions[:0],
        accelerations=positions[:0],
        effort=positions[:0],
        time_from_start=duration(sec=later_ns // 10**9, nanosec=later_ns % 10**9),
    )
    trajectory = bag.type("trajectory_msgs/msg/JointTrajectory")
    # The time 0 means: begin at once.
    message = trajectory(header=bag.header(0, ""), joint_names=names, points=[point])
    bag.write(f"{SPACE}/joint_trajectory", message, stamp_ns)
