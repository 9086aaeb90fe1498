"""'cardbox view --live' passes the nodes' results to the viewer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, Pose, PoseArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from cardbox_tracker.ros import live_view

TOPICS = {
    *("body_model", "tracking_state", "joint_states", "joint_states_stddev", "keypoints"),
    "keypoint_states",
    *("overlay", "retarget/robot_description", "retarget/joint_states"),
}


class Feed:
    """Viewer that records its calls."""

    def __init__(self, _: Any) -> None:
        self.told: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *values: self.told.append((name, *values))


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    rclpy.init(args=[])
    made = live_view.LiveView(Feed(None))  # type: ignore[arg-type]
    yield made
    made.destroy_node()
    rclpy.shutdown()


def hand(node: Any, topic: str, message: Any) -> None:
    (end,) = [s for s in node.subscriptions if s.topic_name == f"/{topic}"]
    end.callback(message, {"source_timestamp": 0})


def stamped(message: Any, seconds: int) -> Any:
    message.header.stamp.sec = seconds
    return message


def test_every_result_is_shown_under_its_stamp(node: Any) -> None:
    own = {s.topic_name.lstrip("/") for s in node.subscriptions}
    assert own >= TOPICS
    joints = JointState(name=["elbow"], position=[0.5])
    hand(node, "tracking_state", String(data="tracking"))  # before the first image
    hand(node, "joint_states", stamped(joints, 2))
    hand(node, "tracking_state", String(data="lost"))
    hand(node, "joint_states_stddev", stamped(JointState(), 2))
    states = DiagnosticArray(status=[DiagnosticStatus(message="lost")])
    hand(node, "keypoint_states", stamped(states, 2))
    hand(node, "keypoints", stamped(PoseArray(poses=[Pose(position=Point(x=1.0))]), 2))
    image = Image(height=1, width=2, step=6, encoding="bgr8", data=bytes(6))
    hand(node, "overlay", stamped(image, 3))
    hand(node, "body_model", String(data="yaml"))
    hand(node, "retarget/robot_description", String(data="<robot/>"))
    hand(node, "retarget/joint_states", JointState(name=["a"], position=[1.0]))
    told = {name: values for name, *values in node._scene.told}
    assert [name for name, *_ in node._scene.told] == [
        *("joints", "state", "deviations", "keypoint_states", "keypoints", "image"),
        *("model", "robot", "robot_joints"),
    ]
    assert told["joints"][0] == told["state"][0] == 2 * 10**9
    assert told["state"][1] == "lost"
    assert told["keypoint_states"] == [2 * 10**9, ["lost"]]
    np.testing.assert_array_equal(told["keypoints"][1], [(1.0, 0.0, 0.0)])
    assert told["image"][1].shape == (1, 2, 3)
    assert told["robot"] == ["retarget", "<robot/>"]
    # The robot holds its position without a new image.
    assert told["robot_joints"][0] == 2 * 10**9
