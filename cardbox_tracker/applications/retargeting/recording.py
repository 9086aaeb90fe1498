"""``cardbox retarget``: robot commands for a bag of results, as a CSV file and as a bag."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.retargeting.retargeter import Command, Moment, Retargeter
from cardbox_tracker.common.files import write_table
from cardbox_tracker.person.skeleton import HAND_OPEN_NAMES, JOINT_NAMES, NECK_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN

SPACE = "/retarget"
"""Namespace of the robot's topics in the bag, equal to the node's."""
# The robot has stood still for long in a gap between stamps, which may be of years.
_LONGEST_NS = 1_000_000_000


class StampedCommand(NamedTuple):
    """A command and the stamp of its image."""

    stamp_ns: int
    command: Command


class StampedMoment(NamedTuple):
    """The robot at one time: the status of the image before, positions and velocities."""

    stamp_ns: int
    status: str
    moment: Moment


class Motion(NamedTuple):
    """The commands of the images, and the robot's way at its own rate."""

    commands: list[StampedCommand]
    way: list[StampedMoment]


def retarget_results(results: Results, retargeter: Retargeter, rate_hz: float) -> Motion:
    """Return the robot's motion for the results of a person."""
    motion = Motion([], [])
    joints = (*JOINT_NAMES, *NECK_NAMES)
    each = results.of(joints), results.deviations_of(joints), results.of(HAND_OPEN_NAMES)
    of_image = results.stamp_ns.tolist(), results.state, results.bodies
    images = zip(*of_image, *each, results.keypoints(), strict=True)
    for stamp_ns, state, body, values, deviations, hands, keypoints in images:
        posture = stddev = None
        if state in (TRACKING, UNCERTAIN):
            if not np.isfinite(deviations[: len(JOINT_NAMES)]).all():
                continue
            posture, stddev = values, deviations
        if motion.commands:
            motion.way.extend(_until(stamp_ns, motion.commands, retargeter, rate_hz))
        command = retargeter.update(
            *(stamp_ns, state, body, posture, stddev), hands=hands, keypoints=keypoints
        )
        motion.commands.append(StampedCommand(stamp_ns, command))
    if motion.commands:
        last = motion.commands[-1]
        end_ns = last.stamp_ns + round(last.command.duration_s * 1e9)
        motion.way.extend(_until(end_ns + 1, motion.commands, retargeter, rate_hz))
    return motion


def _until(
    end_ns: int, commands: Sequence[StampedCommand], retargeter: Retargeter, rate_hz: float
) -> Iterator[StampedMoment]:
    """Yield the way from the last command to ``end_ns``, at times counted from the first."""
    first_ns, (stamp_ns, command) = commands[0].stamp_ns, commands[-1]
    end_ns = min(end_ns, stamp_ns + _LONGEST_NS)
    number = math.ceil((stamp_ns - first_ns) * rate_hz / 1e9)
    while (time_ns := first_ns + round(number * 1e9 / rate_hz)) < end_ns:
        yield StampedMoment(time_ns, command.status, retargeter.at(time_ns))
        number += 1


def write_csv(way: Sequence[StampedMoment], joints: Sequence[str], path: Path) -> None:
    """Write stamp, ns, status, positions (rad or m), velocities of each time, or CardboxError."""
    rows = (
        (str(stamp_ns), status, *(f"{value:.6f}" for part in moment for value in part))
        for stamp_ns, status, moment in way
    )
    velocities = [f"{joint}_velocity" for joint in joints]
    write_table(path, ("stamp_ns", "status", *joints, *velocities), rows)


def write_bag(
    bag: BagReader,
    motion: Motion,
    joints: Sequence[str],
    urdf: str,
    path: Path,
    overwrite: bool = False,
) -> None:
    """Write results with the topics of the node ``retarget``; raise BagError if it exists."""
    latched = [topic for topic in bag.topics if topic.endswith(("_model", "_description"))]
    description = f"{SPACE}/robot_description"
    with BagWriter(path, "mcap", overwrite, compress=True, latched=[*latched, description]) as out:
        for message in bag.messages():
            if out.knows(message.msgtype):
                out.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        if motion.commands:
            out.write_string(description, motion.commands[0].stamp_ns, urdf)
        for stamp_ns, command in motion.commands:
            _write_command(out, stamp_ns, command, joints)
        for stamp_ns, _, moment in motion.way:
            out.write_joint_state(f"{SPACE}/joint_states", stamp_ns, "", joints, *moment)


def _write_command(bag: BagWriter, stamp_ns: int, command: Command, joints: Sequence[str]) -> None:
    bag.write_string(f"{SPACE}/status", stamp_ns, command.status)
    sec, nanosec = divmod(round(command.duration_s * 1e9), 10**9)
    point = bag.new(
        "trajectory_msgs/msg/JointTrajectoryPoint",
        positions=command.positions,
        time_from_start=bag.new("builtin_interfaces/msg/Duration", sec=sec, nanosec=nanosec),
    )
    # A controller starts a trajectory with the stamp 0 at once.
    message = bag.new(
        "trajectory_msgs/msg/JointTrajectory", joint_names=list(joints), points=[point]
    )
    bag.write(f"{SPACE}/joint_trajectory", message, stamp_ns)
