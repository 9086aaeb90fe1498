"""A robot that follows a tracked person stops within its limits at each fault, and goes on."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool

from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.runtime import qos

CONFIG = Path(__file__).parents[2] / "config"
ARM = CONFIG / "example_arm.urdf"
ABDUCTION = JOINT_NAMES.index("right_shoulder_abduction")
PERIOD_S, WAVE_S = 1 / 15, 4.0
# The default max_speed; a message may be late on a loaded machine.
SPEED, LATE_S = 1.0, 0.1
ENABLE = "retarget/enable"


class Robot:
    """A person before a camera, the tracker, ``retarget`` and a robot that does what it is told.

    Attributes:
        sent: commands with the times at which they were sent, s.
    """

    def __init__(self, graph: Any, scene: Any) -> None:
        self.graph, self.scene = graph, scene
        self.model = graph.folder / "model.yaml"
        save_body_model(scene.body, self.model)
        self.start_tracker()
        graph.start(
            "retarget",
            robot_file=ARM,
            joint_map_file=CONFIG / "example_joint_map.yaml",
        )
        node = graph.node
        self.images = node.create_publisher(Image, "silhouette", qos.RESULT)
        self.infos = node.create_publisher(CameraInfo, "silhouette/camera_info", qos.RESULT)
        self.tells = node.create_publisher(JointState, "retarget/robot_joint_states", qos.RESULT)
        self.sent: list[tuple[float, JointState]] = []
        node.create_subscription(JointState, "retarget/joint_states", self._obey, qos.RESULT)
        self.said = graph.collect(String, "retarget/status", qos.LATCHED)
        names = list(load_robot(ARM).joints)
        self.where = JointState(name=names, position=[0.0] * len(names))
        self.tells_where, self.stamp_s, self.began_s = True, 1000.0, time.monotonic()

    def start_tracker(self) -> None:
        self.tracker = self.graph.start("tracker", model_file=self.model, use_image="false")

    def _obey(self, message: JointState, info: dict[str, int]) -> None:
        self.where = JointState(name=message.name, position=message.position)
        self.sent.append((info["source_timestamp"] / 1e9, message))

    def see(self, seconds: float, is_there: bool = True, has_camera: bool = True) -> None:
        """Let the time pass, with images of the person, or of nobody, or without."""
        for _ in range(round(seconds / PERIOD_S)):
            self.stamp_s += PERIOD_S
            if self.tells_where:
                self.tells.publish(self.where)
            if has_camera:
                posture = reference_posture("front")
                posture[0] = self.scene.body.placement.lateral_m
                phase = 2 * np.pi * (time.monotonic() - self.began_s) / WAVE_S
                posture[ABDUCTION] = 0.8 - 0.4 * np.cos(phase)
                outline = self.scene.silhouette(posture if is_there else None)
                header = Header(frame_id="eye")
                header.stamp.sec = int(self.stamp_s)
                header.stamp.nanosec = int(self.stamp_s % 1 * 1e9)
                self.infos.publish(camera_info_message(header, self.scene.camera))
                self.images.publish(image_message(header, outline, "mono8"))
            self.graph.spin(PERIOD_S)

    def enable(self, value: bool) -> None:
        client = self.graph.node.create_client(SetBool, ENABLE)
        self.graph.wait(client.service_is_ready, ENABLE)
        self.graph.wait(client.call_async(SetBool.Request(data=value)).done, "an answer")

    def moves(self) -> None:
        """Wait until the robot follows the person."""
        for _ in range(60):
            before = len(self.sent)
            self.see(0.5)
            new = [message.position[0] for _, message in self.sent[before:]]
            if self.said[-1].data == "following" and new and np.ptp(new) > 0.05:
                return
        raise AssertionError([one.data for one in self.said[-5:]])


@pytest.fixture(scope="module")
def robot(graph: Any, scene: Any) -> Iterator[Robot]:
    made = Robot(graph, scene)
    graph.wait(lambda: graph.node.count_subscribers("silhouette") == 1, "the tracker")
    graph.wait(lambda: graph.node.count_subscribers("retarget/robot_joint_states"), "retarget")
    made.see(2.0)
    assert not made.sent  # nothing before it is enabled
    made.enable(True)
    yield made


def tracker_killed(robot: Robot) -> None:
    robot.tracker.stop(signal.SIGKILL)
    robot.graph.processes.remove(robot.tracker)
    robot.see(2.0)
    robot.start_tracker()


def camera_stops(robot: Robot) -> None:
    robot.see(2.0, has_camera=False)


def person_leaves(robot: Robot) -> None:
    robot.see(2.0, is_there=False)


def joint_states_stop(robot: Robot) -> None:
    robot.tells_where = False
    robot.see(2.0)
    robot.tells_where = True


def disabled(robot: Robot) -> None:
    robot.enable(False)
    robot.see(2.0)


def clock_jumps_ahead(robot: Robot) -> None:
    robot.stamp_s += 3600.0


def clock_jumps_back(robot: Robot) -> None:
    robot.stamp_s -= 1800.0


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (tracker_killed, "faulted: no posture"),
        (camera_stops, "faulted: no posture"),
        (person_leaves, "faulted: no person"),
        (joint_states_stop, "faulted: the robot's joint states"),
        (disabled, "disabled"),
        (clock_jumps_ahead, ""),
        (clock_jumps_back, ""),
    ],
)
def test_a_robot_stops_and_goes_on_after_a_fault(robot: Robot, fault: Any, words: str) -> None:
    robot.moves()
    first = len(robot.sent) - 1
    fault(robot)
    if words:
        assert words in robot.said[-1].data
        assert np.abs(robot.sent[-1][1].velocity).max() < 0.05
        stopped = len(robot.sent)
        robot.see(1.0)
        assert len(robot.sent) == stopped  # it does not go on by itself
        robot.enable(True)
    # The person is elsewhere meanwhile, so that a robot that went there at once would jump.
    robot.began_s -= WAVE_S / 2
    robot.moves()
    times = np.array([at_s for at_s, _ in robot.sent[first:]])
    positions = np.array([one.position for _, one in robot.sent[first:]])
    speeds = np.array([one.velocity for _, one in robot.sent[first:]])
    jumps = np.abs(np.diff(positions, axis=0)).max(axis=1)
    assert (jumps <= SPEED * (np.diff(times) + LATE_S)).all()
    assert np.abs(speeds).max() <= SPEED + 1e-6
