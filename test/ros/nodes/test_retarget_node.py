"""The node ``retarget`` commands a robot only while the tracker is sure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from cardbox_tracker.body.model_file import dumps_body_model  # noqa: E402
from cardbox_tracker.body.proportions import body_from_proportions  # noqa: E402
from cardbox_tracker.errors import CardboxError  # noqa: E402
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode  # noqa: E402

CONFIG = Path(__file__).parents[3] / "config"
MODEL = String(data=dumps_body_model(body_from_proportions(1.75, 2.0, 0.4, 0.0)))


def make(**parameters: Any) -> Any:
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    return RetargetNode(parameter_overrides=overrides, enable_rosout=False)


@pytest.fixture
def ros() -> Iterator[None]:
    rclpy.init(args=[])
    yield
    rclpy.shutdown()


@pytest.fixture
def node(ros: None, heard: Any) -> Iterator[Any]:
    joint_map = str(CONFIG / "example_joint_map.yaml")
    made = make(robot_file=str(CONFIG / "example_arm.urdf"), joint_map_file=joint_map)
    made._trajectory, made._commands, made._robot_joints, made._says = (heard() for _ in range(4))
    made._on_model(MODEL, 0)
    yield made
    made.destroy_node()


@pytest.fixture
def send(node: Any, joints: Any) -> Callable[..., None]:
    """Hand the node what the tracker sends of one image."""

    def hand_over(tenth: int, state: str = "tracking", deviation: float = 0.1) -> None:
        node._on_state(String(data=state), 0)
        node._on_joints(joints(tenth, {"right_shoulder_abduction": 1.0}), 0)
        node._on_stddev(joints(tenth, {}, other=deviation), 0)

    return hand_over


def said(node: Any) -> list[str]:
    return [message.data for message in node._says.messages]


def test_an_arm_moves_at_its_speed_and_stops_when_the_person_is_lost(node: Any, send: Any) -> None:
    for tenth in range(3):
        send(tenth)
    moved = np.array([message.data.tolist() for message in node._commands.messages])
    np.testing.assert_allclose(moved, [[0, 0, 0], [-0.1, 0, 0], [-0.2, 0, 0]], atol=1e-12)
    node._on_state(String(data="lost"), 0)
    node._on_state(String(data="lost"), 0)
    assert said(node) == ["moving", "frozen: lost"]
    assert len(node._commands.messages) == 4  # standing still is said once
    assert node._commands.messages[-1].data.tolist() == pytest.approx([-0.2, 0, 0])
    last = node._trajectory.messages[-1]
    assert last.joint_names == ["shoulder_roll", "shoulder_pitch", "elbow_pitch"]
    assert last.points[0].positions.tolist() == pytest.approx([-0.2, 0, 0])
    assert (last.header.stamp.sec, last.header.stamp.nanosec) == (0, 0)


def test_an_uncertain_posture_moves_nothing(node: Any, send: Any) -> None:
    send(0)
    send(1, deviation=2.0)
    send(2, state="uncertain")
    assert {tuple(message.data) for message in node._commands.messages} == {(0.0, 0.0, 0.0)}
    assert said(node) == ["moving", "frozen: too uncertain", "frozen: uncertain"]


def test_silence_is_a_dead_man_too(node: Any, send: Any) -> None:
    send(0)
    node._check()
    assert said(node) == ["moving"]
    node._heard_s -= 1.0
    node._check()
    assert said(node) == ["moving", "frozen: no posture for 0.5 s"]


def test_a_node_without_a_robot_does_not_start(ros: None, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="robot_file"):
        make()
    with pytest.raises(CardboxError, match="No such file"):
        make(robot_file=str(tmp_path / "arm.urdf"))
