"""The tracker node with several people: topics, service and diagnostics of each."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import TORSO_Y, reference_posture
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.6, hip_height_m=-0.25)


def silhouette(*aside_m: float) -> np.ndarray:
    image = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    for one in aside_m:
        posture = reference_posture("front")
        posture[TORSO_Y] = one
        image |= render(cardbox_patches(BODY, posture), CAMERA)
    return image


@pytest.fixture
def node(bus: Any) -> Any:
    node = bus.start(TrackerNode, people=2, use_image=False, rep155_id="p")
    bus.send("/body_model", String(data=dumps_body_model(BODY)))
    return node


def show(bus: Any, tenth: int, *aside_m: float, second: int = 1) -> None:
    header = Header(frame_id="eye", stamp=Time(sec=second, nanosec=tenth * 10**8))
    bus.send("/silhouette/camera_info", camera_info_message(header, CAMERA))
    bus.send("/silhouette", image_message(header, silhouette(*aside_m), "mono8"))


def test_each_person_has_the_topics(bus: Any, node: Any) -> None:
    show(bus, 0, -0.6)
    show(bus, 1, -0.6, 0.6)
    for tenth in range(2, 6):
        show(bus, tenth, -0.6, 0.6)
    assert bus.texts("/person_2/tracking_state")[0] == "no_person"
    for person, aside_m in ((1, -0.6), (2, 0.6)):
        last = bus.sent[f"/person_{person}/joint_states"][-1]
        values = dict(zip(last.name, last.position, strict=True))
        assert values["torso_y"] == pytest.approx(aside_m, abs=0.1)
        assert f"torso_p_{person}" in bus.sent[f"/humans/bodies/p_{person}/urdf"][-1].data
    assert "/joint_states" not in bus.sent
    keys = {value.key for value in bus.tick().values}
    assert {"person 1 state", "person 2 state"} <= keys and "state" not in keys


def test_who_is_absent_is_a_value_and_an_image_has_an_age(bus: Any, node: Any) -> None:
    second = int(time.time()) - 2
    for tenth in range(8):
        show(bus, tenth, -0.6, second=second)
    status = bus.tick()
    values = {value.key: value.value for value in status.values}
    assert values["absent people"] == "2" and "person 2" not in status.message
    ages_ms = [float(values[f"image to joint states p{share} (ms)"]) for share in (50, 95)]
    assert 1000.0 < ages_ms[0] <= ages_ms[1]
    for tenth in range(8, 10):
        show(bus, tenth, second=second)
    status = bus.tick()
    assert "nobody is in the image" in status.message and "person" not in status.message
    assert {value.value for value in status.values if value.key == "absent people"} == {"1, 2"}


def test_one_person_is_reset_alone(bus: Any, node: Any) -> None:
    for tenth in range(5):
        show(bus, tenth, -0.6, 0.6)
    assert node._reset_person(2) == "person 2 is sought again"
    assert [one.estimate.posture is None for one in node._session._people] == [False, True]
    show(bus, 6, -0.6, 0.6)
    assert bus.texts("/person_2/tracking_state")[-1] != "no_person"


def test_several_people_are_tracked_without_depth(bus: Any) -> None:
    with pytest.raises(CardboxError, match="several people are tracked without depth"):
        bus.start(TrackerNode, people=2, cameras=["a"], depth="depth")
