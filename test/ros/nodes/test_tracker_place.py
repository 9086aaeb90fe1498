"""The place and the state on the tracker node's topics, with a fake tracker."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from sensor_msgs.msg import CameraInfo, Image, JointState  # noqa: E402
from std_msgs.msg import Header, String  # noqa: E402

from cardbox_tracker.camera.camera import Camera  # noqa: E402
from cardbox_tracker.person.kinematics import pose  # noqa: E402
from cardbox_tracker.person.model import BodyModel  # noqa: E402
from cardbox_tracker.person.model_file import save_body_model  # noqa: E402
from cardbox_tracker.person.posture import reference_posture  # noqa: E402
from cardbox_tracker.person.skeleton import JOINT_NAMES, LEG_NAMES  # noqa: E402
from cardbox_tracker.ros.messages.conversions import (  # noqa: E402
    camera_info_message,
    image_message,
)
from cardbox_tracker.ros.nodes import tracker_node  # noqa: E402
from cardbox_tracker.ros.runtime import qos  # noqa: E402
from cardbox_tracker.tracking import session  # noqa: E402
from cardbox_tracker.tracking.estimate import LOST, TRACKING, UNCERTAIN, Estimate  # noqa: E402
from cardbox_tracker.tracking.tracker import Tracker  # noqa: E402

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
POSTURE = reference_posture("arms")
PLACE = np.array([0.25, -0.05])
WAIT_S = 30.0


def found(state: str) -> Estimate:
    """Return an estimate 0.25 m nearer and 0.05 m lower than the measured person."""
    body = Estimate(state, offset_m=PLACE).placed(BODY)
    points_m = CAMERA.reference_to_optical(pose(body.rigid, POSTURE).keypoints_m)
    return Estimate(
        *(state, POSTURE, np.full(12, 0.1), points_m, 812, 0.75),
        offset_m=PLACE,
        offset_stddev_m=np.array([0.03, 0.01]),
    )


class Told(Tracker):
    """Returns the estimate in ``says``."""

    says = Estimate(LOST)

    def track(self, *_: Any) -> Estimate:
        return self.says


class Graph:
    """A tracker node, and a node that sends silhouettes and receives the results."""

    def __init__(self, **parameters: Any) -> None:
        self._context = Context()
        rclpy.init(context=self._context, args=[])
        self._executor = SingleThreadedExecutor(context=self._context)
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        options: dict[str, Any] = {"context": self._context, "enable_rosout": False}
        self._tracker = tracker_node.TrackerNode(parameter_overrides=overrides, **options)
        self._probe = rclpy.create_node("probe", **options)
        for node in (self._tracker, self._probe):
            self._executor.add_node(node)
        self._silhouettes = self._probe.create_publisher(Image, "silhouette", qos.SILHOUETTE)
        self._infos = self._probe.create_publisher(
            CameraInfo, "silhouette/camera_info", qos.SILHOUETTE
        )
        self._images = self._probe.create_publisher(Image, "silhouette/image", qos.SILHOUETTE)
        self._stamp_s = 0

    def collect(self, kind: Any, topic: str, profile: Any = qos.RESULT) -> list[Any]:
        messages: list[Any] = []
        self._probe.create_subscription(kind, topic, messages.append, profile)
        self.wait(lambda: self._probe.count_publishers(topic) == 1)
        return messages

    def wait(self, condition: Callable[[], Any]) -> Any:
        end = time.monotonic() + WAIT_S
        while not (value := condition()):
            # Each image needs several input and output messages.
            for _ in range(10):
                self._executor.spin_once(timeout_sec=0.02)
            assert time.monotonic() < end, "it did not come"
        return value

    def show(self, estimate: Estimate, seen: np.ndarray | None = None) -> None:
        """Let the tracker find ``estimate`` in the next image, which is ``seen``."""
        Told.says = estimate
        self._stamp_s += 1
        header = Header(frame_id="eye", stamp=Time(sec=self._stamp_s))
        self._infos.publish(camera_info_message(header, CAMERA))
        if seen is not None:
            self._images.publish(image_message(header, seen))
        image = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
        self._silhouettes.publish(image_message(header, image, "mono8"))

    def show_until(
        self,
        estimate: Estimate,
        condition: Callable[[], Any],
        seen: np.ndarray | None = None,
    ) -> None:
        """Show images until ``condition`` holds, because DDS matches topics one by one."""

        def is_there() -> Any:
            value = condition()
            if not value:
                self.show(estimate, seen)
            return value

        self.wait(is_there)

    def close(self) -> None:
        self._executor.shutdown()
        self._tracker.close()
        for node in (self._tracker, self._probe):
            node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def make(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Graph]]:
    """Return a function that starts a tracker node with a measured person."""
    monkeypatch.setattr(session, "Tracker", Told)
    save_body_model(BODY, tmp_path / "person.yaml")
    made: list[Graph] = []

    def start(**parameters: Any) -> Graph:
        made.append(Graph(model_file=str(tmp_path / "person.yaml"), **parameters))
        return made[-1]

    yield start
    for graph in made:
        graph.close()


CLAVICLE_NAMES = ("left_clavicle_elevation", "right_clavicle_elevation")


def test_all_joints_arrive(make: Callable[..., Graph]) -> None:
    graph = make()
    states = graph.collect(JointState, "joint_states")
    deviations = graph.collect(JointState, "joint_states_stddev")
    graph.show_until(found(TRACKING), lambda: states and deviations)
    names = (*JOINT_NAMES, "torso_x", "torso_z")
    assert tuple(states[-1].name) == (
        *names,
        *("neck_yaw", "neck_pitch"),
        *CLAVICLE_NAMES,
        *LEG_NAMES,
    )
    assert tuple(deviations[-1].name) == (*names, *CLAVICLE_NAMES, *LEG_NAMES)
    np.testing.assert_array_equal(states[-1].position, [*POSTURE, *PLACE, *[0.0] * 12])
    known = [0.1] * 12 + [0.03, 0.01, 0.0, 0.0]
    np.testing.assert_array_equal(deviations[-1].position[: len(known)], known)


def test_the_place_can_be_left_out(make: Callable[..., Graph]) -> None:
    graph = make(torso_place=False, rep155_id="p1")
    states = graph.collect(JointState, "joint_states")
    deviations = graph.collect(JointState, "joint_states_stddev")
    humans = graph.collect(JointState, "/humans/bodies/p1/joint_states")
    graph.show_until(found(TRACKING), lambda: states and deviations and humans)
    for message in (states[-1], deviations[-1]):
        assert tuple(message.name) == JOINT_NAMES
    assert len(humans[-1].name) == len(humans[-1].position) == 12


def test_the_place_is_among_the_joints_of_rep155(make: Callable[..., Graph]) -> None:
    graph = make(rep155_id="p1")
    humans = graph.collect(JointState, "/humans/bodies/p1/joint_states")
    texts = graph.collect(String, "/humans/bodies/p1/robot_description", qos.LATCHED)
    graph.show_until(found(TRACKING), lambda: humans and texts)
    joints = dict(zip(humans[-1].name, humans[-1].position, strict=True))
    assert len(joints) == 18
    assert (joints["x_body_p1"], joints["z_body_p1"]) == tuple(PLACE)
    for name in joints:
        assert f'<joint name="{name}"' in texts[-1].data


def test_every_image_has_its_state(make: Callable[..., Graph]) -> None:
    """The state of a doubtful posture comes with it, and the diagnostics warn."""
    graph = make()
    words = graph.collect(String, "tracking_state")
    states = graph.collect(JointState, "joint_states")
    diagnostics = graph.collect(DiagnosticArray, "/diagnostics", 10)
    graph.show_until(found(TRACKING), lambda: words and states)

    before = len(states)
    graph.show_until(found(UNCERTAIN), lambda: len(states) > before)
    graph.wait(lambda: words[-1].data == UNCERTAIN)

    def warned() -> Any:
        status = diagnostics[-1].status[0] if diagnostics else None
        return status if status and "the posture may be wrong" in status.message else None

    status = graph.wait(warned)
    values = {value.key: value.value for value in status.values}
    assert status.level == status.WARN
    assert values["state"] == UNCERTAIN
    assert int(values["images uncertain"]) >= 1
    assert (values["torso_x (m)"], values["torso_z (m)"]) == ("0.250", "-0.050")

    for count in range(1, 4):
        graph.show(Estimate(LOST))
        graph.wait(lambda count=count: [word.data for word in words].count(LOST) == count)
    assert words[-1].data == LOST


def test_the_overlay_is_drawn_on_the_image_or_else_on_the_silhouette(
    make: Callable[..., Graph],
) -> None:
    graph = make()
    overlays = graph.collect(Image, "overlay", qos.SENSOR_DATA)
    wall = np.full((CAMERA.height, CAMERA.width, 3), (30, 60, 90), np.uint8)

    def corner() -> list[int]:
        return list(overlays[-1].data[-3:]) if overlays else []

    graph.show_until(found(TRACKING), lambda: corner() == [0, 0, 0])
    graph.show_until(found(TRACKING), lambda: corner() == [30, 60, 90], wall)
    # A different background node may not publish images.
    graph.show_until(found(TRACKING), lambda: corner() == [0, 0, 0])
