"""The node ``rula`` scores what the tracker publishes, and says nothing of half a pair."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from cardbox_tracker.body.model_file import dumps_body_model  # noqa: E402
from cardbox_tracker.body.proportions import body_from_proportions  # noqa: E402
from cardbox_tracker.errors import CardboxError  # noqa: E402
from cardbox_tracker.ros.nodes.rula_node import RulaNode  # noqa: E402

MODEL = String(data=dumps_body_model(body_from_proportions(1.75, 2.0, 0.4, 0.0)))


@pytest.fixture
def node(heard: Any) -> Iterator[Any]:
    rclpy.init(args=[])
    made = RulaNode(enable_rosout=False)
    made._score, made._chances, made._report = heard(), heard(), heard()
    yield made
    made.destroy_node()
    rclpy.shutdown()


def test_a_pair_is_scored_under_its_stamp(node: Any, joints: Any) -> None:
    node._on_model(MODEL, 0)
    node._on_joints(joints(7, {"left_shoulder_abduction": 1.75, "torso_pitch": 0.6}), 0)
    node._on_stddev(joints(7, {}, other=0.001), 0)
    (report,) = node._report.messages
    assert report.header.stamp.nanosec == 7 * 10**8
    values = {value.key: value.value for value in report.status[0].values}
    assert values["likeliest score"] == "5"
    assert float(values["score with the right arm"]) < float(values["score with the left arm"])
    assert node._score.messages[0].data == pytest.approx(float(values["score"]), abs=0.01)
    chances = np.array(node._chances.messages[0].data)
    assert chances.argmax() + 1 == 5
    assert chances.sum() == pytest.approx(1)


def test_deviations_of_another_image_are_not_taken(node: Any, joints: Any) -> None:
    node._on_model(MODEL, 0)
    node._on_joints(joints(7, {}), 0)
    node._on_stddev(joints(8, {}), 0)
    assert not node._score.messages


def test_without_a_body_nothing_is_said(node: Any, joints: Any) -> None:
    node._on_joints(joints(7, {}), 0)
    node._on_stddev(joints(7, {}), 0)
    assert not node._score.messages


def test_what_is_no_posture_is_refused(node: Any, joints: Any) -> None:
    node._on_model(MODEL, 0)
    node._on_joints(JointState(name=["elbow"], position=[0.0]), 0)
    with pytest.raises(CardboxError, match="torso_y"):
        node._on_stddev(JointState(), 0)
    node._on_joints(joints(9, {"torso_pitch": float("nan")}), 0)
    with pytest.raises(CardboxError, match="not finite"):
        node._on_stddev(joints(9, {}), 0)
