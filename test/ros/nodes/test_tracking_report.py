"""What is said of the state of tracking: each change once, and the figures of the last posture."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.nodes.tracker_node import TrackingReport
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate

BODY = BodyModel()


def found(state: str) -> Estimate:
    points_m = np.zeros((6, 3))
    return Estimate(state, np.zeros(12), np.full(12, 0.1), points_m, 812, 0.75)


def test_each_change_of_state_is_told_once() -> None:
    report = TrackingReport()
    report.start(BODY)
    told = [report.add(found(state), BODY) for state in (TRACKING, TRACKING, UNCERTAIN)]
    assert [list(news) for news in told] == [["state"], [], ["state"]]
    # Uncertain images come and go: only what is worse is told after them.
    assert report.add(found(TRACKING), BODY) == {}
    report.add(found(UNCERTAIN), BODY)
    assert "tracker/reset" in report.add(Estimate(LOST), BODY)["state"]
    assert "tracker/reset" in report.warnings()[""]
    report.add(found(TRACKING), BODY)
    assert report.warnings() == {}
    values = report.values({})
    assert (values["cost (px)"], values["iou"]) == ("812", "0.7500")
    report.add(Estimate(TRACKING, np.zeros(12)), BODY)
    assert not {"cost (px)", "iou"} & report.values({}).keys()


@pytest.mark.parametrize("preset", PRESETS)
def test_who_was_measured_is_not_fitted_with_any_preset(
    preset: str, bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shoulders of preset paper are rigid, which makes no other person of them."""
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Header, String

    from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
    from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

    node = bus.start(TrackerNode, preset=preset, use_image=False)
    said: list[str] = []
    log = SimpleNamespace(info=said.append, warning=said.append, error=said.append)
    monkeypatch.setattr(node, "get_logger", lambda: log)
    camera = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
    person = render(cardbox_patches(BODY, reference_posture("front")), camera)
    bus.send("/body_model", String(data=dumps_body_model(BODY)))
    for number in range(2):
        header = Header(frame_id="eye", stamp=Time(sec=10 + number))
        bus.send("/silhouette/camera_info", camera_info_message(header, camera))
        bus.send("/silhouette", image_message(header, person, "mono8"))
    assert len(bus.texts("/tracking_state")) == 2
    assert any("tracking starts" in text for text in said)
    assert not [text for text in said if "fitted to the person" in text]


def test_a_dark_image_is_no_empty_one(bus: Any) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Header

    from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
    from cardbox_tracker.ros.nodes.background_node import BackgroundNode
    from cardbox_tracker.ros.nodes.tracker_node import TrackerNode

    camera, rng = Camera(96, 72, 99.0, 99.0, 47.5, 35.5), np.random.default_rng(1)
    bus.start(TrackerNode, stature=1.7)
    bus.send("/silhouette/camera_info", camera_info_message(Header(frame_id="eye"), camera))
    for grey, words in ((0.0, "dark"), (90.0, "nobody is in the image"), (400.0, "overexposed")):
        for number in range(2):
            header = Header(frame_id="eye", stamp=Time(sec=int(10 + grey + number)))
            seen = np.clip(rng.normal(grey, 4, (72, 96)), 0, 255).astype(np.uint8)
            bus.send("/silhouette/image", image_message(header, seen, "mono8"))
            bus.send("/silhouette", image_message(header, np.zeros_like(seen), "mono8"))
        assert words in bus.tick().message
    bus.start(BackgroundNode)
    bus.send("/camera_info", camera_info_message(Header(frame_id="eye"), camera))
    header = Header(frame_id="eye", stamp=Time(sec=1000))
    bus.send("/image_raw", image_message(header, np.zeros((72, 96), np.uint8), "mono8"))
    bus.tick()
    told = [value.value for value in bus.sent["/diagnostics"][-1].status[0].values]
    assert any("/image_raw: the image is dark" in text and "lens" in text for text in told)


def test_another_body_is_told_with_its_sizes() -> None:
    report = TrackingReport()
    report.start(BODY)
    other = BodyModel.of(hip_height_m=-0.4)
    told = report.add(found(TRACKING), other)["body"]
    assert told.startswith("fitted to the person") and str(other) in told
    assert "body" not in report.add(found(TRACKING), other)


def test_values_have_counts_then_those_of_the_cameras_then_figures() -> None:
    report = TrackingReport()
    assert report.values({}) == {"state": "not started"}
    for estimate in (found(TRACKING), found(TRACKING), Estimate(NO_PERSON)):
        report.add(estimate, BODY)
    values = report.values({"left late": "0"})
    assert values == {
        "state": NO_PERSON,
        f"images {TRACKING}": "2",
        f"images {NO_PERSON}": "1",
        "left late": "0",
    }
    report.add(found(TRACKING), BODY)
    values = report.values({"left late": "0"})
    assert values["largest deviation (deg)"] == "5.7"
    assert list(values).index("left late") < list(values).index("largest deviation (deg)")
