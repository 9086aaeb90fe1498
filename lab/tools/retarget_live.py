"""Measure how robots follow recorded people live, through the real nodes.

python -m lab.tools.retarget_live --robot URDF [--robot URDF ...] SESSION...

The images of a session come in real time to ``detector`` and ``tracker``, which know stature and
pitch, and to a node ``retarget`` with its defaults for each robot. A simulated robot goes where it
is sent and tells where it is. The motions are played forwards and backwards in turn, so that nobody
jumps. ``--write`` replaces the table in ``docs/retargeting.md``. Its figures change from run to
run, and are worse where other programs take the processor.
"""

from __future__ import annotations

import argparse
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from cardbox_tracker.applications.retargeting.arm import ArmFollower, directions_of
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    KEYPOINT_NAMES,
    rotation_x,
    rotation_y,
    rotation_z,
)
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes
from lab.pages import replaced, row, table
from lab.tools.retarget_accuracy import DOCUMENT, degrees_between
from lab.tools.way_cases import Case, cases_of
from lab.tools.way_nodes import live, prepare

BEGIN, END = "<!-- retarget-live:begin -->", "<!-- retarget-live:end -->"
_HEAD = (
    *("recording", "robot", "postures", "behind what is tracked", "behind the person", "lag"),
    *("commands", "largest step", "follows", "changes", "faults"),
)
_LENGTH_S, _AT_ONCE = 60.0, 2
# Time constant of the robot's actuators, and the period in which it tells where it is, s.
_ACTUATOR_S, _PERIOD_S = 0.05, 0.02
_LAGS_S, _NEAR_S = np.arange(0.0, 1.5, 0.02), 1.0
_INPUTS = "joint_states", "joint_states_stddev", "tracking_state", "body_model", "keypoint_states"


def repeated(case: Case, path: Path) -> tuple[Case, dict[int, int]]:
    """Write the motions of a case's camera to a bag for a minute, forwards and backwards in turn.

    Returns the case with this bag, and the recorded stamp of each of its stamps, ns.
    """
    with BagReader(case.bag) as bag, BagWriter(path) as out:
        images, infos = bag.image_topic(case.cameras[0]), bag.camera_info_topic(case.cameras[0])
        start_ns = bag.start_ns + round(case.start_s * 1e9)
        shown: dict[int, list[Any]] = {}
        for message in bag.messages([images, infos]):
            if message.time_ns >= start_ns:
                shown.setdefault(message.time_ns, []).append(message)
        stamps = sorted(shown)
        period_ns = (stamps[-1] - stamps[0]) // (len(stamps) - 1)
        found: dict[int, int] = {}
        for number in range(round(_LENGTH_S * 1e9) // period_ns):
            there = number % (2 * len(stamps) - 2)
            old_ns = stamps[min(there, 2 * len(stamps) - 2 - there)]
            new_ns = stamps[0] + number * period_ns
            found[new_ns] = old_ns
            for one in shown[old_ns]:
                # In CDR, the stamp of the header is behind four bytes.
                stamp = struct.pack("<iI", *divmod(new_ns, 10**9))
                raw = bytes(one.raw[:4]) + stamp + bytes(one.raw[12:])
                out.write_raw(one.topic, one.msgtype, raw, new_ns)
    return replace(case, bag=path, empty=None), found


class _Robot:
    """A simulated robot, which goes where its node ``retarget`` sends it, and what came of it."""

    def __init__(self, path: Path, nodes: Nodes, node: Any, space: str) -> None:
        """Start its node, and subscribe to it with ``node``; the tracker is in ``space``."""
        self.name, self._robot = path.stem, load_robot(path)
        own = f"/{self.name}"
        words = [f"{own}/{one}:={space}/{one}" for one in (*_INPUTS, "hands")]
        inputs = [word for one in words for word in ("-r", one)]
        nodes.start(
            *("retarget", "--ros-args", "-r", f"__ns:={own}", "-p", f"robot_file:={path}", *inputs),
            called=f"retarget_{self.name}",
        )
        self.status_topic = f"{own}/retarget/status"
        self.said: list[tuple[float, str]] = []
        self.sent: list[tuple[float, FloatArray]] = []
        self.way: list[tuple[float, FloatArray]] = []
        self.follower = ArmFollower(self._robot, RetargetConfig())
        self._at = self._robot.positions_of("start", "", self.follower.joints, 0.0)
        self._tells = node.create_publisher(
            JointState, f"{own}/retarget/robot_joint_states", qos.LATEST
        )
        self._enable = node.create_client(SetBool, f"{own}/retarget/enable")
        node.create_subscription(String, self.status_topic, self._on_status, qos.LATCHED)
        node.create_subscription(
            JointState, f"{own}/retarget/joint_states", self._on_command, qos.REPLAY
        )
        node.create_timer(_PERIOD_S, self._tick)

    def _on_status(self, message: String) -> None:
        self.said.append((time.monotonic(), message.data))
        # Somebody is there who enables it anew.
        if message.data.startswith(("disabled", "faulted")):
            self._enable.call_async(SetBool.Request(data=True))

    def _on_command(self, message: JointState) -> None:
        by_name = dict(zip(message.name, message.position, strict=True))
        positions = np.array([by_name[name] for name in self.follower.joints])
        self.sent.append((time.monotonic(), positions))

    def _tick(self) -> None:
        now_s = time.monotonic()
        if self.sent and self.way:
            passed_s = now_s - self.way[-1][0]
            self._at = self._at + (self.sent[-1][1] - self._at) * -np.expm1(-passed_s / _ACTUATOR_S)
        self.way.append((now_s, self._at))
        self._tells.publish(JointState(name=list(self.follower.joints), position=list(self._at)))

    def directions(self, at_s: FloatArray) -> FloatArray:
        """Return shoulder to hand (..., 3) in the person's torso at times of the clock."""
        times, way = zip(*self.way, strict=True)
        at = np.stack([np.interp(at_s, times, one) for one in np.transpose(way)], axis=-1)
        arm = at[..., : len(self.follower.arm.joints)].reshape(len(at_s.ravel()), -1)
        found = [self.follower.kinematics.directions(one)[2] for one in arm]
        return (np.array(found) @ self.follower.mount.T).reshape(*at_s.shape, 3)

    def largest_step(self) -> float:
        """Return the largest step between two commands, of that which the limit of speed allows.

        Not when it begins to follow, for it then begins where the robot is.
        """
        config = RetargetConfig()
        speed = np.minimum(self._robot.limits_of(self.follower.joints)[2], config.max_speed)
        times = np.array([at_s for at_s, _ in self.sent[1:]])
        steps = np.abs(np.diff([one for _, one in self.sent], axis=0)) / speed
        for (_, before), (at_s, after) in pairwise(self.said):
            if before.startswith("ready") and after == "following":
                steps[np.abs(times - at_s) < _NEAR_S] = 0.0
        return float(steps.max() * config.rate_hz)

    def cells(
        self, seen_s: FloatArray, shown_s: FloatArray, tracked: FloatArray, true: FloatArray
    ) -> list[object]:
        """Return what the table says of the robot from its first following on.

        ``seen_s`` are the times of images with a 3D reference, in which the person is seen well,
        ``shown_s`` (n,) those of images that were tracked, with the directions from shoulder to
        hand (n, 3) that were found and that are true.
        """
        times, texts = zip(*self.said, strict=True)
        first = texts.index("following")
        later = shown_s >= times[first] + RetargetConfig().soft_start_s
        found = self.directions(shown_s[later, None] + _LAGS_S)
        off = degrees_between(found, tracked[later, None])
        behind = [off[:, 0], degrees_between(found[:, 0], true[later])]
        shares = ("{:.0f} / {:.0f}°".format(*np.nanpercentile(one, (50, 90))) for one in behind)
        lag_s = float(_LAGS_S[np.nanmedian(off, axis=0).argmin()])
        at = np.searchsorted(times, seen_s[seen_s > times[first]]) - 1
        follows = np.mean([texts[i] == "following" for i in at])
        # The last image is followed by a fault.
        changes = texts[first + 1 : np.searchsorted(times, seen_s[-1])]
        print(self.name, dict(Counter(changes)))
        faults = sum(text.startswith("faulted") for text in changes)
        rate_hz = (len(self.sent) - 1) / (self.sent[-1][0] - self.sent[0][0])
        rate, step = f"{rate_hz:.0f} Hz", f"{self.largest_step():.0%}"
        return [*shares, f"{lag_s:.2f} s", rate, step, f"{follows:.1%}", len(changes), faults]


def true_directions(case: Case, results: Results, recorded: dict[int, int]) -> FloatArray:
    """Return the right hand of each result from its shoulder, as it is, in the tracked torso.

    Shape (n, 3), of length 1; nan where it is not known.
    """
    to_level = level_to_optical(np.radians(case.pitch_deg))
    shoulder, hand = (KEYPOINT_NAMES.index(f"right_{one}") for one in ("shoulder", "hand"))
    torso = [f"torso_{one}" for one in ("roll", "pitch", "yaw")]
    found = np.full((len(results.stamp_ns), 3), np.nan)
    for number, (stamp_ns, angles) in enumerate(
        zip(results.stamp_ns.tolist(), results.of(torso), strict=True)
    ):
        joints = case.people[0].joints_m.get(recorded.get(stamp_ns, -1))
        if joints is not None:
            roll, pitch, yaw = angles
            bone = (joints[hand] - joints[shoulder]) @ to_level
            bone = bone @ rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
            found[number] = bone / np.linalg.norm(bone)
    return found


def measured(case: Case, paths: Sequence[Path], folder: Path) -> list[str]:
    """Return the rows of robots that follow the person of a case at the same time."""
    played, recorded = repeated(case, folder / "played")
    robots: list[_Robot] = []
    came: dict[int, float] = {}
    known: dict[int, float] = {}
    with BagReader(played.bag) as bag:
        info = bag.camera_info_topic(case.cameras[0])

    def further(nodes: Nodes, node: Any, space: str) -> list[str]:
        for kind, topic, times in (
            (CameraInfo, info, came),
            (JointState, f"{space}/joint_states_stddev", known),
        ):
            take = partial(
                lambda times, one: times.update({stamp_ns_of(one): time.monotonic()}), times
            )
            node.create_subscription(kind, topic, take, qos.REPLAY)
        robots.extend(_Robot(path, nodes, node, space) for path in paths)
        return [robot.status_topic for robot in robots]

    (results,) = live(played, folder, 1.0, further)
    seconds = sorted(known.values())
    rate_hz = (len(seconds) - 1) / (seconds[-1] - seconds[0])
    late_s = np.median([at_s - came[stamp_ns] for stamp_ns, at_s in known.items()])
    of_tracker = f"{rate_hz:.0f} Hz, {late_s:.2f} s"
    true = true_directions(case, results, recorded)
    postures = results.of(JOINT_NAMES)
    shown = np.array([came[stamp_ns] for stamp_ns in results.stamp_ns.tolist()])
    tracked = np.array(
        [
            np.full(3, np.nan) if body is None else directions_of(body, one, "right")[2]
            for body, one in zip(results.bodies, postures, strict=True)
        ]
    )
    seen = {new_ns for new_ns, old_ns in recorded.items() if old_ns in case.people[0].joints_m}
    seen_s = np.array([at_s for stamp_ns, at_s in came.items() if stamp_ns in seen])
    return [
        row((case.name, robot.name, of_tracker, *robot.cells(seen_s, shown, tracked, true)))
        for robot in robots
    ]


def main() -> int:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--robot", action="append", type=Path, metavar="URDF", required=True)
    parser.add_argument("--write", action="store_true", help="write the table into the document")
    given = parser.parse_args()
    prepare()
    rows = [table(_HEAD, ())]
    for session in given.sessions:
        case = next(cases_of(session))
        for number in range(0, len(given.robot), _AT_ONCE):
            with tempfile.TemporaryDirectory() as name:
                found = measured(case, given.robot[number : number + _AT_ONCE], Path(name))
            rows += found
            print(*found, sep="\n", flush=True)
    if given.write:
        text = DOCUMENT.read_text(encoding="utf-8")
        write_file(DOCUMENT, replaced(text, "\n" + "\n".join(rows) + "\n", BEGIN, END))
    return 0


if __name__ == "__main__":
    sys.exit(main())
