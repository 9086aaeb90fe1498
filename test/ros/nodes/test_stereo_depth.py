"""The depth images of the node stereo_depth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode

CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)
BASELINE_M, DEPTH_M = 0.12, 1.5
DISPARITY = round(250.0 * BASELINE_M / DEPTH_M)


@pytest.fixture(autouse=True)
def node(bus: Any) -> None:
    bus.start(StereoDepthNode, tolerance_s=0.002)


def header(stamp_ms: int, frame: str = "left_optical_frame") -> Header:
    return Header(stamp=Time(sec=1, nanosec=1_000_000 * stamp_ms), frame_id=frame)


def give_infos(bus: Any, p03: float = -250.0 * BASELINE_M) -> None:
    left, right = (camera_info_message(header(0), CAMERA) for _ in range(2))
    right.p[3] = p03
    bus.send("/left/camera_info", left)
    bus.send("/right/camera_info", right)


def pair(left_ms: int, right_ms: int) -> tuple[Any, Any]:
    texture = np.random.default_rng(0).integers(0, 255, (240, 320 + DISPARITY)).astype(np.uint8)
    left, right = texture[:, :320], texture[:, DISPARITY:]
    return image_message(header(left_ms), left), image_message(header(right_ms, "right"), right)


def test_depth_of_a_wall(bus: Any) -> None:
    give_infos(bus)
    left, right = pair(40, 41)
    bus.send("/right/image_raw", right)
    bus.send("/left/image_raw", left)
    (depth,), (info,) = bus.sent["/depth"], bus.sent["/depth/camera_info"]
    assert (depth.encoding, depth.width, depth.height) == ("32FC1", 320, 240)
    assert depth.header == left.header == info.header
    assert info.k[0] == CAMERA.fx
    metres = np.frombuffer(depth.data, np.float32).reshape(240, 320)
    assert np.nanmedian(metres) == pytest.approx(DEPTH_M, rel=0.02)
    # At the left border, depth is unknown because the right camera does not see it.
    assert np.isnan(metres[:, : DISPARITY - 4]).all()
    assert np.isfinite(metres[20:-20, 60:-20]).mean() > 0.9


def test_only_images_of_one_time_are_a_pair_and_each_is_used_once(bus: Any) -> None:
    give_infos(bus)
    left, right = pair(40, 45)
    bus.send("/left/image_raw", left)
    bus.send("/right/image_raw", right)
    assert bus.sent["/depth"] == []
    later, same = pair(45, 45)
    bus.send("/left/image_raw", later)
    assert bus.sent["/depth"][0].header == later.header
    bus.send("/right/image_raw", same)
    assert len(bus.sent["/depth"]) == 1


def test_what_is_no_rectified_pair_is_said(bus: Any) -> None:
    left, right = pair(40, 40)
    bus.send("/left/image_raw", left)
    bus.send("/right/image_raw", right)
    assert bus.sent["/depth"] == []
    for stamp_ms, p03, text in ((80, 0.0, "not a rectified pair"), (120, 30.0, "left camera the")):
        give_infos(bus, p03)
        left, right = pair(stamp_ms, stamp_ms)
        bus.send("/left/image_raw", left)
        bus.send("/right/image_raw", right)
        status = bus.tick()
        assert status.level == DiagnosticStatus.ERROR
        assert text in status.message


@pytest.mark.promise("Cameras that disagree, or that come and go, are reported")
@pytest.mark.parametrize("swapped", [False, True])
def test_swapped_images_are_told(bus: Any, swapped: bool) -> None:
    give_infos(bus)
    left, right = pair(40, 40)
    if swapped:
        left.data, right.data = right.data, left.data
    bus.send("/right/image_raw", right)
    bus.send("/left/image_raw", left)
    assert len(bus.sent["/depth"]) == 1
    status = bus.tick()
    assert ("/right/image_raw swapped?" in status.message) == swapped
    assert (status.level == DiagnosticStatus.WARN) == swapped
