"""``cardbox retarget``: moves a robot arm as a person's arm."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    Written,
    check_outputs,
    option,
    print_remarks,
)
from cardbox_tracker.common.errors import CardboxError


@dataclass(frozen=True, kw_only=True)
class Arguments(TrackedResults, Written, RetargetConfig):
    """Results, the robot, and what is written.

    Attributes:
        robot: the robot
        map: which joint moves which, as in config/example_joint_map.yaml; without it the robot's
            arm is found and points as the person's
        csv: table of the robot's joints and their velocities
        bag: a bag of results with the robot beside the person, for 'cardbox view'
        stream: send the robot's joints in real time by ZMQ, as tcp://127.0.0.1:5557, for LeRobot
    """

    group = "limits and mounting"
    robot: Path = option("ROBOT.urdf", required=True)
    map: Path | None = option("MAP.yaml")
    csv: Path | None = option("OUT.csv")
    bag: Path | None = option("OUT")
    stream: str | None = option("ADDRESS")


def run(given: Arguments) -> None:
    """Retarget a recording to the robot and write the results."""
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
        (given.csv,),
        given.force,
        inputs=(given.results, given.robot, given.map),
        results=() if given.bag is None else (given.bag,),
    )
    if given.bag is not None and not is_bag(given.results):
        raise CardboxError(f"--bag adds the robot to a bag; {given.results} is a table")
    robot, retargeter, table = make_retargeter(given.robot, given.map, given)
    results = given.read()
    results.check_body()
    motion = retarget_results(results, retargeter, given.rate_hz)
    joints = retargeter.joints
    if table:
        print(table)
    if given.csv is not None:
        write_csv(motion.way, joints, given.csv)
    if given.bag is not None:
        with BagReader(given.results) as bag:
            write_bag(bag, motion, joints, robot.urdf, given.bag, given.force)
    for status, count in Counter(step.command.status for step in motion.commands).most_common():
        print(f"{status}: {count} of {len(motion.commands)} images")
    for path in (given.csv, given.bag):
        if path is not None:
            print(f"wrote {path}")
    if given.stream is not None:
        lower, upper, _ = retargeter.limits
        with closing(ZmqSender(given.stream)) as sender:
            print_remarks(sender.remarks)
            for stamp_ns, _, moment in in_real_time(motion.way, given.rate_hz):
                sender.send(joints_packet(stamp_ns, joints, moment.positions, lower, upper))
