"""Simulated cameras for running nodes, and an account of what they sent and what came of it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import String

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.skeleton import PLACE_NAMES
from cardbox_tracker.recordings.outputs import joints_of
from cardbox_tracker.ros.messages.conversions import camera_info_message
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes
from lab.tools.fault_nodes import header_of
from lab.tools.fault_scene import Found, Person, S

_START_S = 300.0
# The nodes publish their counts once a second.
_SETTLE_S = 3.0


class Line:
    """One camera and the tracker behind it.

    Attributes:
        sent: number of images sent.
        states: number of answers of each state.
        took_s: latency of each posture since the last sample, seconds.
        errors_m: mean error of the keypoints of each posture since then, metres.
        answered: numbers of the images that have a posture.
    """

    def __init__(self, node: Any, space: str, topic: str, profile: Any, person: Person) -> None:
        """Publish on ``topic`` below the namespace ``space``, and subscribe to the results."""
        info = "camera_info" if topic == "image_raw" else f"{topic}/camera_info"
        self._person = person
        self._images = node.create_publisher(Image, f"{space}{topic}", profile)
        self._infos = node.create_publisher(CameraInfo, f"{space}{info}", profile)
        self._answers = node.create_subscription(
            String, f"{space}tracking_state", self._count, qos.REPLAY
        )
        node.create_subscription(JointState, f"{space}joint_states", self._note, qos.REPLAY)
        self.sent, self.states = 0, Counter[str]()
        self.took_s, self.errors_m, self.answered = list[float](), list[float](), set[int]()
        self._due: dict[int, tuple[int, float, float]] = {}

    @property
    def is_connected(self) -> bool:
        """Whether each topic has its subscriber, and the tracker has started."""
        return all(
            (
                self._images.get_subscription_count(),
                self._infos.get_subscription_count(),
                self._answers.get_publisher_count(),
            )
        )

    def send(self, stamp_ns: int, message: Image, at_s: float) -> None:
        """Send an image of the person's posture at ``at_s``."""
        message.header = header_of(stamp_ns)
        self._infos.publish(camera_info_message(message.header, self._person.camera))
        self._due[stamp_ns] = self.sent, time.monotonic(), at_s
        self._images.publish(message)
        self.sent += 1
        if len(self._due) > 1000:
            del self._due[next(iter(self._due))]

    def _count(self, message: String) -> None:
        self.states[message.data] += 1

    def _note(self, message: JointState) -> None:
        stamp = message.header.stamp
        stamp_ns = stamp.sec * S + stamp.nanosec
        if stamp_ns not in self._due:
            return
        number, sent_s, at_s = self._due.pop(stamp_ns)
        joints = joints_of(message)
        found = Found(stamp_ns, joints.posture, joints.of(PLACE_NAMES))
        self.took_s.append(time.monotonic() - sent_s)
        self.errors_m.append(self._person.error_m(found, at_s))
        self.answered.add(number)


class Cameras:
    """The cameras of all namespaces, sending side by side."""

    def __init__(self, nodes: Nodes, spaces: Sequence[str], topic: str, profile: Any) -> None:
        """Connect to the ``nodes``; signals stay with the program.

        Args:
            nodes: the running nodes.
            spaces: namespace of each camera, empty or with a slash at its end.
            topic: topic of the images within a namespace.
            profile: QoS of the images.

        Raises:
            CardboxError: the nodes do not subscribe in time, or one died.
        """
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.person, self._nodes = Person(), nodes
        self._node = rclpy.create_node("endurance", enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._values: dict[str, dict[str, str]] = {}
        self._told: dict[str, set[str]] = {}
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, qos.REPLAY)
        self.lines = [Line(self._node, s, topic, profile, self.person) for s in spaces]
        end_s = time.monotonic() + _START_S
        while not all(line.is_connected for line in self.lines):
            self.spin_until(time.monotonic() + 0.2)
            if time.monotonic() > end_s:
                raise CardboxError("the nodes do not subscribe to the images; see their logs")
        self.spin_until(time.monotonic() + _SETTLE_S)

    def _diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.partition(":")[0]
            values = {one.key: one.value for one in status.values}
            self._values[name] = values
            warnings = [text for key, text in values.items() if key.startswith("warning")]
            self._told.setdefault(name, set()).update(text[:40] for text in warnings)

    def spin_until(self, due_s: float) -> None:
        """Take results until a monotonic time.

        Raises:
            CardboxError: a node died.
        """
        while (left_s := due_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)
        self._nodes.check()

    def run(
        self,
        seconds: float,
        rate_hz: float,
        image: Callable[[int], tuple[Image, float]],
        sample: tuple[float, Callable[[float], None]],
    ) -> None:
        """Send images from each camera at a rate; the cameras take turns within a period.

        Args:
            seconds: length.
            rate_hz: images a second of each camera.
            image: returns the message of an image and the time of its posture, by its number.
            sample: seconds between samples, and a function that is called with the time since
                the start for each of them.
        """
        start_s, start_ns, count = time.monotonic(), time.time_ns(), round(seconds * rate_hz)
        every_s, take = sample
        next_s = every_s
        for number in range(count + 1):
            if number == count:
                # The loss of the last images is seen by the spacing to a later one.
                self.spin_until(time.monotonic() + _SETTLE_S)
            message, at_s = image(number)
            for place, line in enumerate(self.lines):
                share = (number + place / len(self.lines)) / rate_hz
                self.spin_until(start_s + share)
                line.send(start_ns + round(share * S), message, at_s)
            passed_s = time.monotonic() - start_s
            if passed_s >= next_s and number < count:
                take(passed_s)
                next_s = passed_s + every_s
        self.spin_until(time.monotonic() + _SETTLE_S)
        take(time.monotonic() - start_s)

    def account(self, node: str, sent: int) -> Counter[str]:
        """Compare what was sent to a node with what it received and what it says it lost."""
        values = self._values.get(node, {})
        received, told = (int(values.get(key, 0)) for key in ("received", "dropped (by stamps)"))
        return Counter(
            sent=sent,
            received=received,
            published=int(values.get("published", 0)),
            told=told,
            silent=sent - received - told,
            warnings=len(self._told.get(node, ())),
        )

    def warnings(self, node: str) -> set[str]:
        """Return the beginnings of all warnings that a node published."""
        return self._told.get(node, set())

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()  # type: ignore[no-untyped-call]
        try_shutdown()
