"""The tracker node's lag: results come later, and shake less."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message, stamp_ns
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.tracking import session
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)
STEP_NS = 33_000_000


class Shaking(Tracker):
    """Finds the person 2 cm to the left and to the right in turns."""

    images = 0

    def track(self, *_: Any) -> Estimate:
        posture = reference_posture("arms")
        posture[0] = 0.02 * (-1.0) ** self.images
        self.images += 1
        points_m = CAMERA.reference_to_optical(pose(BODY, posture).keypoints_m)
        place = {"offset_m": np.zeros(2), "offset_stddev_m": np.full(2, 0.01)}
        return Estimate(TRACKING, posture, np.full(12, 0.1), points_m, 812, 0.75, **place)


@pytest.fixture
def node(bus: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(session, "Tracker", Shaking)

    def start(**parameters: Any) -> None:
        bus.start(TrackerNode, use_image=False, **parameters)
        bus.send("/body_model", String(data=dumps_body_model(BODY)))

    return start


def show(bus: Any, numbers: range) -> None:
    for number in numbers:
        stamp = Time(sec=1 + number * STEP_NS // 10**9, nanosec=number * STEP_NS % 10**9)
        header = Header(frame_id="eye", stamp=stamp)
        bus.send("/silhouette/camera_info", camera_info_message(header, CAMERA))
        image = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
        bus.send("/silhouette", image_message(header, image, "mono8"))


def stamps_and_places(bus: Any) -> tuple[list[int], np.ndarray]:
    messages = bus.sent["/joint_states"]
    stamps = [(stamp_ns(one.header.stamp) - 10**9) // STEP_NS for one in messages]
    return stamps, np.array([one.position[0] for one in messages])


def test_without_a_lag_results_come_at_once_as_they_are(bus: Any, node: Any) -> None:
    node()
    show(bus, range(20))
    stamps, places = stamps_and_places(bus)
    assert stamps == [*range(20)]
    np.testing.assert_array_equal(np.abs(places), 0.02)


def test_with_a_lag_each_result_comes_later_with_its_own_stamp(bus: Any, node: Any) -> None:
    node(lag=0.1)
    show(bus, range(20))
    stamps, places = stamps_and_places(bus)
    # 0.1 s are just over three steps, so four later images have come.
    assert stamps == [*range(16)]
    assert np.abs(places[6:]).max() < 0.004
    assert len(bus.sent["/keypoints"]) == 16
    # The last ones of a stream that has ended do not wait for ever.
    bus.tick()
    assert len(stamps_and_places(bus)[0]) == 16
    bus.tick()
    assert stamps_and_places(bus)[0] == [*range(20)]
    show(bus, range(20, 26))
    bus.tick()
    assert stamps_and_places(bus)[0] == [*range(22)]
    # A source that begins again gets what waited, and another beginning.
    show(bus, range(-60, -50))
    stamps, _ = stamps_and_places(bus)
    assert stamps[22:] == [22, 23, 24, 25, *range(-60, -54)]


def test_the_paper_s_filter_has_no_lag(bus: Any) -> None:
    with pytest.raises(CardboxError, match=r"lag is 0\.2; .* preset default"):
        bus.start(TrackerNode, lag=0.2, preset="paper")
