"""With publish_tf the tracker publishes the transforms of robot_state_publisher."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.urdf import LinkTransforms, urdf_from_body
from cardbox_tracker.recordings.outputs import joint_values, positions_of
from cardbox_tracker.ros.nodes.tracker_outputs import TfOutputs
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate

BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
FOUND = Estimate(TRACKING, reference_posture("arms"), offset_m=np.array([0.25, -0.05]))
DEFAULTS = {"torso_place": True, "optical_frame_in_tf": True, "hands": False}


class TFMessage(SimpleNamespace):
    """Replaces the message of tf2_msgs, which is not on PyPI."""


def published(*estimates: Estimate, **settings: bool) -> list[Any]:
    sent: list[Any] = []

    def advertise(kind: Any, topic: str, profile: Any) -> Any:
        assert (kind, topic, profile.depth) == (TFMessage, "/tf", 100)
        return SimpleNamespace(publish=sent.append)

    given: Any = SimpleNamespace(**(DEFAULTS | settings))
    outputs = TfOutputs(SimpleNamespace(advertise=advertise), given)  # type: ignore[arg-type]
    tracker: Any = SimpleNamespace(body=BODY)
    for estimate in estimates:
        outputs.publish(Header(frame_id="eye", stamp=Time(sec=7)), estimate, tracker)
    return sent


@pytest.fixture
def with_tf2_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("tf2_msgs.msg")
    module.__dict__["TFMessage"] = TFMessage
    monkeypatch.setitem(sys.modules, "tf2_msgs", ModuleType("tf2_msgs"))
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", module)


@pytest.mark.usefixtures("with_tf2_msgs")
def test_every_link_is_sent_in_the_posture_of_its_image() -> None:
    (message,) = published(FOUND, Estimate(LOST))
    joints = joint_values(FOUND)
    assert joints is not None
    expected = LinkTransforms(urdf_from_body(BODY, "eye")).at(positions_of(joints))
    # There are 18 joints, hips, head, two wrists, and the camera's optical frame.
    assert len(message.transforms) == len(expected) == 34
    for sent, link in zip(message.transforms, expected, strict=True):
        assert (sent.header.frame_id, sent.child_frame_id) == (link.parent, link.child)
        assert sent.header.stamp.sec == 7
        place, turn = sent.transform.translation, sent.transform.rotation
        assert (place.x, place.y, place.z) == link.translation_m
        assert (turn.x, turn.y, turn.z, turn.w) == link.rotation


@pytest.mark.usefixtures("with_tf2_msgs")
@pytest.mark.parametrize(
    ("setting", "link"), [("optical_frame_in_tf", "eye"), ("torso_place", "torso_x_link")]
)
def test_what_another_node_says_can_be_left_out(setting: str, link: str) -> None:
    def children(**settings: bool) -> set[str]:
        (message,) = published(FOUND, **settings)
        return {transform.child_frame_id for transform in message.transforms}

    assert link in children()
    assert link not in children(**{setting: False})


def test_without_tf2_msgs_the_text_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)
    with pytest.raises(CardboxError, match=r"publish_tf .*tf2_msgs"):
        published()
