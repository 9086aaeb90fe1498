"""What the node stereo_depth publishes, of pairs that are handed to it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from builtin_interfaces.msg import Time  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_msgs.msg import Header  # noqa: E402

from cardbox_tracker.errors import CameraError  # noqa: E402
from cardbox_tracker.ros.messages.conversions import (  # noqa: E402
    camera_info_message,
    image_message,
)
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode  # noqa: E402
from cardbox_tracker.vision.camera import Camera  # noqa: E402

CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)
BASELINE_M, DEPTH_M = 0.12, 1.5
DISPARITY = round(250.0 * BASELINE_M / DEPTH_M)


class Kept:
    """In place of a publisher."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def publish(self, message: Any) -> None:
        self.messages.append(message)


@pytest.fixture
def node() -> Iterator[StereoDepthNode]:
    rclpy.init(args=[])
    made = StereoDepthNode(
        parameter_overrides=[Parameter("tolerance_s", value=0.002)], enable_rosout=False
    )
    made._depth = made._depth_info = Kept()
    yield made
    made.close()
    made.destroy_node()
    rclpy.shutdown()


def header(stamp_ms: int, frame: str = "left_optical_frame") -> Header:
    return Header(stamp=Time(sec=1, nanosec=1_000_000 * stamp_ms), frame_id=frame)


def give_infos(node: StereoDepthNode, p03: float = -250.0 * BASELINE_M) -> None:
    left, right = (camera_info_message(header(0), CAMERA) for _ in range(2))
    right.p[3] = p03
    node._on_left_info(left, 0)
    node._on_right_info(right, 0)


def pair(left_ms: int, right_ms: int) -> tuple[Any, Any]:
    texture = np.random.default_rng(0).integers(0, 255, (240, 320 + DISPARITY)).astype(np.uint8)
    left, right = texture[:, :320], texture[:, DISPARITY:]
    return image_message(header(left_ms), left), image_message(header(right_ms, "right"), right)


def test_depth_of_a_wall(node: StereoDepthNode) -> None:
    give_infos(node)
    left, right = pair(40, 41)
    node._on_right(right, 0)
    node._on_left(left, 0)
    depth, info = node._depth.messages
    assert (depth.encoding, depth.width, depth.height) == ("32FC1", 320, 240)
    assert depth.header == left.header == info.header
    assert info.k[0] == CAMERA.fx
    metres = np.frombuffer(depth.data, np.float32).reshape(240, 320)
    assert np.nanmedian(metres) == pytest.approx(DEPTH_M, rel=0.02)
    # Left of what the right camera sees nothing is known.
    assert np.isnan(metres[:, : DISPARITY - 4]).all()
    assert np.isfinite(metres[20:-20, 60:-20]).mean() > 0.9


def test_only_images_of_one_time_are_a_pair_and_each_is_used_once(node: StereoDepthNode) -> None:
    give_infos(node)
    left, right = pair(40, 45)
    node._on_left(left, 0)
    node._on_right(right, 0)
    assert node._depth.messages == []
    later, same = pair(45, 45)
    node._on_left(later, 0)
    assert node._depth.messages[0].header == later.header
    node._on_right(same, 0)
    assert len(node._depth.messages) == 2


def test_what_is_no_rectified_pair_is_said(node: StereoDepthNode) -> None:
    left, right = pair(40, 40)
    node._on_left(left, 0)
    node._on_right(right, 0)
    assert node._depth.messages == []
    for stamp_ms, p03, text in ((80, 0.0, "rectified"), (120, 30.0, "left camera")):
        give_infos(node, p03)
        left, right = pair(stamp_ms, stamp_ms)
        node._on_left(left, 0)
        with pytest.raises(CameraError, match=text):
            node._on_right(right, 0)
