"""The tracker node looks at hands: topic, joints, robot description, diagnostics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.hand_network import HandPoints
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.pose_network import LANDMARKS, NOBODY, Square
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import HAND_NAMES, LEG_NAMES
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.messages.keypoints import people_message
from cardbox_tracker.ros.nodes import tracker_node
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.51)
POSTURE = reference_posture("front")
OUTLINE = render(cardbox_patches(BODY, POSTURE), CAMERA)
POINTS = "/detector/keypoints"


class Network:
    """Finds the same stretched hand in each square."""

    def __init__(self, _: Path) -> None:
        pass

    def __call__(self, image: Any, square: Square) -> HandPoints:
        at = np.zeros((21, 3))
        for finger, across in enumerate(np.linspace(-0.04, 0.04, 5)):
            for bone in range(4):
                at[1 + 4 * finger + bone] = across, 0.04 + 0.03 * bone, 0.0
        px = np.full((21, 2), (square.u, square.v)) + 300.0 * at[:, :2]
        return HandPoints(px, at)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracker_node, "installed_hands", lambda: Path("hand.tflite"))
    monkeypatch.setattr(tracker_node, "HandNetwork", Network)


@pytest.mark.parametrize(("people", "space"), [(0, ""), (1, "/person_1")])
def test_hands_are_published_with_their_joints(
    bus: Any, installed: None, detected: Any, people: int, space: str
) -> None:
    points = detected(BODY, CAMERA, POSTURE)
    px, scores = np.zeros((len(LANDMARKS), 2)), np.zeros(len(LANDMARKS))
    for number, name in enumerate(LANDMARKS):
        if name in POINT_INDEX:
            px[number] = np.nan_to_num(points.px[POINT_INDEX[name]])
            scores[number] = points.scores[POINT_INDEX[name]]
    bus.start(TrackerNode, hands=True, keypoints="detector/keypoints", people=people)
    bus.send("/body_model", String(data=dumps_body_model(BODY)))
    for tenth in range(8):
        header = Header(frame_id="eye", stamp=Time(sec=1, nanosec=tenth * 10**8))
        bus.send("/silhouette/camera_info", camera_info_message(header, CAMERA))
        bus.send("/camera_info", camera_info_message(header, CAMERA))
        person = NOBODY._replace(points_px=px, scores=scores)
        bus.send(POINTS, people_message(header, [person]))
        image = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
        bus.send("/silhouette/image", image_message(header, image, "bgr8"))
        bus.send("/silhouette", image_message(header, OUTLINE, "mono8"))
    opened, joints = (bus.sent[f"{space}/{name}"][-1] for name in ("hands", "joint_states"))
    assert opened.name == ["left_hand_open", "right_hand_open"]
    assert min(opened.position) > 0.75
    hands = slice(-6 - len(LEG_NAMES), -len(LEG_NAMES))
    assert tuple(joints.name[hands]) == HAND_NAMES
    assert any(joints.position[hands]) and not any(joints.velocity[hands])
    values = {value.key: value.value for value in bus.tick().values}
    person = "person 1 " if people else ""
    assert values[f"{person}hands used"] == "8 of 8"


@pytest.mark.parametrize("wrong", [{}, {"keypoints": "a/b", "use_image": False}])
def test_hands_need_points_and_images(bus: Any, wrong: dict[str, Any]) -> None:
    with pytest.raises(CardboxError, match="hands needs images, and wrists and knuckles"):
        bus.start(TrackerNode, hands=True, **wrong)


def test_without_hands_there_is_no_topic_of_theirs(bus: Any) -> None:
    node = bus.start(TrackerNode)
    assert "hands" not in node._outputs[0]._publishers
