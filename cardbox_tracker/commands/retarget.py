"""``cardbox retarget``: moves a robot arm as a person's arm."""

from __future__ import annotations

import argparse
from collections import Counter
from contextlib import closing
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    add_force,
    add_results,
    add_settings,
    check_outputs,
    results_of,
    settings_from,
)
from cardbox_tracker.common.errors import CardboxError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox retarget``."""
    from cardbox_tracker.applications.retargeting.config import RetargetConfig

    add_results(parser)
    add = parser.add_argument
    add("--robot", type=Path, required=True, metavar="ROBOT.urdf", help="the robot")
    add(
        "--map",
        type=Path,
        metavar="MAP.yaml",
        help="which joint moves which, as in config/example_joint_map.yaml; without it the robot's "
        "arm is found and points as the person's",
    )
    add(
        "--csv",
        type=Path,
        metavar="OUT.csv",
        help="table of the robot's joints and their velocities",
    )
    add(
        "--bag",
        type=Path,
        metavar="OUT",
        help="a bag of results with the robot beside the person, for 'cardbox view'",
    )
    add(
        "--stream",
        metavar="ADDRESS",
        help="send the robot's joints in real time by ZMQ, as tcp://127.0.0.1:5557, for LeRobot",
    )
    add_force(parser)
    add_settings(parser, RetargetConfig, "limits and mounting")


def run(options: argparse.Namespace) -> None:
    """Retarget a recording to the robot and write the results."""
    from cardbox_tracker.applications.retargeting.config import RetargetConfig
    from cardbox_tracker.applications.retargeting.recording import (
        retarget_results,
        write_bag,
        write_csv,
    )
    from cardbox_tracker.applications.retargeting.retargeter import make_retargeter
    from cardbox_tracker.applications.teleoperation.sending import (
        ZmqSender,
        in_real_time,
        joints_packet,
    )
    from cardbox_tracker.recordings.bag_reader import BagReader
    from cardbox_tracker.recordings.open_images import is_bag

    check_outputs(
        (options.csv,),
        options.force,
        inputs=(options.results, options.robot, options.map),
        results=() if options.bag is None else (options.bag,),
    )
    if options.bag is not None and not is_bag(options.results):
        raise CardboxError(f"--bag adds the robot to a bag; {options.results} is a table")
    config = settings_from(options, RetargetConfig)
    robot, retargeter, table = make_retargeter(options.robot, options.map, config)
    results = results_of(options.results, options.person)
    results.check_body()
    motion = retarget_results(results, retargeter, config.rate_hz)
    joints = retargeter.joints
    if table:
        print(table)
    if options.csv is not None:
        write_csv(motion.way, joints, options.csv)
    if options.bag is not None:
        with BagReader(options.results) as bag:
            write_bag(bag, motion, joints, robot.urdf, options.bag, options.force)
    for status, count in Counter(step.command.status for step in motion.commands).most_common():
        print(f"{status}: {count} of {len(motion.commands)} images")
    for path in (options.csv, options.bag):
        if path is not None:
            print(f"wrote {path}")
    if options.stream is not None:
        lower, upper, _ = retargeter.limits
        with closing(ZmqSender(options.stream)) as sender:
            for stamp_ns, _, moment in in_real_time(motion.way, config.rate_hz):
                sender.send(joints_packet(stamp_ns, joints, moment.positions, lower, upper))
