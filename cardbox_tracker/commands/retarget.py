"""``cardbox retarget``: moves a robot arm as a person's arm."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    add_force,
    add_person,
    add_settings,
    check_outputs,
    settings_from,
)

NAME = "retarget"
HELP = "move a robot arm, given by its URDF, as the measured person moves theirs"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox retarget``."""
    from cardbox_tracker.applications.retargeting.config import RetargetConfig

    parser.add_argument(
        "results", type=Path, metavar="RESULTS", help="bag of results, of 'cardbox track --bag'"
    )
    parser.add_argument("--robot", type=Path, required=True, metavar="ROBOT.urdf", help="the robot")
    parser.add_argument(
        "--map",
        type=Path,
        metavar="MAP.yaml",
        help="which joint moves which, as in config/example_joint_map.yaml; without it the robot's "
        "arm is found and points as the person's",
    )
    parser.add_argument(
        "--csv",
        type=Path,
        metavar="OUT.csv",
        help="table of the robot's joints and their velocities",
    )
    parser.add_argument(
        "--bag",
        type=Path,
        metavar="OUT",
        help="the results with the robot beside the person, for 'cardbox view'",
    )
    add_person(parser)
    add_force(parser)
    add_settings(parser, RetargetConfig, "limits and mounting")


def run(options: argparse.Namespace) -> None:
    """Retarget a recording to the robot and write the results."""
    from cardbox_tracker.applications.retargeting.config import RetargetConfig
    from cardbox_tracker.applications.retargeting.recording import (
        retarget_bag,
        write_bag,
        write_csv,
    )
    from cardbox_tracker.applications.retargeting.retargeter import make_retargeter
    from cardbox_tracker.recordings.bag_reader import BagReader

    check_outputs(
        (options.csv,),
        options.force,
        inputs=(options.results, options.robot, options.map),
        results=() if options.bag is None else (options.bag,),
    )
    config = settings_from(options, RetargetConfig)
    robot, retargeter, table = make_retargeter(options.robot, options.map, config)
    with BagReader(options.results) as bag:
        motion = retarget_bag(bag, retargeter, config.rate_hz, options.person)
        if table:
            print(table)
        if options.csv is not None:
            write_csv(motion.way, retargeter.joints, options.csv)
        if options.bag is not None:
            joints = retargeter.joints
            write_bag(bag, motion, joints, robot.urdf, options.bag, options.force)
    for status, count in Counter(step.command.status for step in motion.commands).most_common():
        print(f"{status}: {count} of {len(motion.commands)} images")
    for path in (options.csv, options.bag):
        if path is not None:
            print(f"wrote {path}")
