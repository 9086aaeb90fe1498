"""The long runs with nodes: one camera for an hour, and trackers in eight namespaces.

Simulated cameras send images, with an account of what they sent and what came of it.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header, String

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.person.skeleton import PLACE_NAMES
from cardbox_tracker.recordings.outputs import joints_of
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes, isolate, running_nodes
from lab.tools.endurance_record import Record, resources_of
from lab.tools.fault_nodes import header_of
from lab.tools.fault_scene import EMPTY, PERSON, Found, Person, S, Sent

RATE_HZ = 15
# The background is learned in the first seconds; later the room is empty for ten of each fifty.
BEGIN_S, MOVING_S, ROUND_S = 8.0, 40.0, 50.0
LEARN_IMAGES = 15
SPACES = tuple(f"person_{number}/" for number in range(1, 9))
MOTION_S = 8.0

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


def is_there(at_s: float) -> bool:
    """Return whether the person is in view."""
    return at_s >= BEGIN_S and (at_s - BEGIN_S) % ROUND_S < MOVING_S


def light(at_s: float) -> float:
    """Return the brightness: clouds within four minutes, and a lamp that switches every seven."""
    return 1.0 + 0.15 * float(np.sin(at_s / 40.0)) + (0.08 if at_s // 420 % 2 else 0.0)


@contextmanager
def _nodes() -> Iterator[tuple[Nodes, Path]]:
    """Start nodes of this checkout, in a DDS domain of their own."""
    root = str(Path(__file__).resolve().parents[2])
    os.environ["PYTHONPATH"] = os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])
    isolate()
    with tempfile.TemporaryDirectory() as folder, running_nodes(Path(folder)) as nodes:
        save_body_model(Person().body, Path(folder) / "body.yaml")
        yield nodes, Path(folder)


def _parameters(**values: Any) -> tuple[str, ...]:
    return tuple(word for name, value in values.items() for word in ("-p", f"{name}:={value}"))


def hour(record: Record, seconds: float) -> None:
    """Run the nodes ``background`` and ``tracker`` while person and light change."""
    with _nodes() as (nodes, folder):
        nodes.start("background", "--ros-args", *_parameters(learn_images=LEARN_IMAGES))
        model = _parameters(model_file=folder / "body.yaml")
        nodes.start("tracker", "--ros-args", *model)
        cameras = Cameras(nodes, [""], "image_raw", qos.CAMERA)
        line, person = cameras.lines[0], cameras.person

        def image(number: int) -> tuple[Any, float]:
            at_s = number / RATE_HZ
            shows = PERSON if is_there(at_s) else EMPTY
            lit = np.clip(person.image(Sent(0, 2.0 + at_s, shows)) * light(at_s), 0, 255)
            return image_message(Header(), lit.astype(np.uint8), "mono8"), 2.0 + at_s

        def take(passed_s: float) -> None:
            background = cameras.account("background", line.sent)
            # A gap before the first node is one before the second as well.
            passed_on = background["published"] + background["told"]
            tracker = cameras.account("tracker", passed_on)
            shown = [number for number in range(line.sent) if is_there(number / RATE_HZ)]
            back = [n for n in shown if not is_there((n - 2 * RATE_HZ) / RATE_HZ) and n > 150]
            come = [n for n in back if is_there((n - 2 * RATE_HZ + 1) / RATE_HZ)]
            record.counts = Counter(
                {
                    "images sent": line.sent,
                    "images received by `background`": background["received"],
                    "images left out on the way and reported": background["told"],
                    "images left out without a report": background["silent"],
                    "silhouettes sent by `background`": background["published"],
                    "silhouettes received by `tracker`": tracker["received"],
                    "silhouettes left out and reported, with those images": tracker["told"],
                    "silhouettes left out without a report": tracker["silent"],
                    "images with the person": len(shown),
                    "of these with a posture": len(line.answered & set(shown)),
                    "postures of an empty room": len(line.answered - set(shown)),
                    "times the person was back for two seconds": len(come),
                    "of these with a posture by then": len(line.answered & set(come)),
                    **{f"answers `{state}`": count for state, count in line.states.items()},
                }
            )
            resources = {name: resources_of(nodes.pid(name)) for name in ("background", "tracker")}
            _sample(record, cameras, passed_s, resources)

        try:
            cameras.run(seconds, RATE_HZ, image, (30.0, take))
        finally:
            cameras.close()


def eight(record: Record, seconds: float) -> None:
    """Run a node ``tracker`` in each of eight namespaces."""
    with _nodes() as (nodes, folder):
        names = [space.strip("/") for space in SPACES]
        model = _parameters(model_file=folder / "body.yaml")
        for name in names:
            words = ("--ros-args", "-r", f"__ns:=/{name}", *model)
            nodes.start("tracker", *words, called=name)
        cameras = Cameras(nodes, SPACES, "silhouette", qos.SILHOUETTE)
        count = round(MOTION_S * RATE_HZ)
        seen = [
            image_message(Header(), cameras.person.silhouette(2.0 + n / RATE_HZ), "mono8")
            for n in range(count)
        ]

        def image(number: int) -> tuple[Any, float]:
            return seen[number % count], 2.0 + number / RATE_HZ

        def take(passed_s: float) -> None:
            told = [
                cameras.account(f"{one}/tracker", cameras.lines[i].sent)
                for i, one in enumerate(names)
            ]
            states = sum((line.states for line in cameras.lines), Counter[str]())
            record.counts = Counter(
                {
                    "images sent": sum(one["sent"] for one in told),
                    "images received": sum(one["received"] for one in told),
                    "images answered": sum(states.values()),
                    "images left out and reported": sum(one["told"] for one in told),
                    "images left out without a report": sum(one["silent"] for one in told),
                    "most without a report at one tracker": max(one["silent"] for one in told),
                    "trackers that warn that they are slow": sum(
                        any("results come" in text for text in cameras.warnings(f"{one}/tracker"))
                        for one in names
                    ),
                    **{f"answers `{state}`": number for state, number in states.items()},
                }
            )
            resources = {name: resources_of(nodes.pid(name)) for name in names}
            _sample(record, cameras, passed_s, resources)

        try:
            cameras.run(seconds, RATE_HZ, image, (10.0, take))
        finally:
            cameras.close()


def _sample(record: Record, cameras: Cameras, passed_s: float, resources: Any) -> None:
    """Add a sample of all cameras, and forget what it contains."""
    took_s = [value for line in cameras.lines for value in line.took_s]
    errors_m = [value for line in cameras.lines for value in line.errors_m]
    for line in cameras.lines:
        line.took_s, line.errors_m = [], []
    images = sum(line.sent for line in cameras.lines)
    error_cm = 100 * float(np.mean(errors_m)) if errors_m else None
    record.add(passed_s, images, took_s, resources, error_cm=error_cm)
    print(f"{passed_s:.0f} s, {images:,} images", flush=True)
