"""The order in which nodes take images and their CameraInfo."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from cardbox_tracker.camera.calibration_watch import LASTING
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_images import CameraImages
from cardbox_tracker.ros.nodes.stereo_depth_node import StereoDepthNode
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)


@pytest.mark.parametrize(
    ("kind", "image"), [(BackgroundNode, "/image_raw"), (TrackerNode, "/silhouette")]
)
def test_an_image_does_not_wait_for_its_camera_info(
    kind: type[CardboxNode], image: str, make_node: Callable[..., Any]
) -> None:
    """An executor takes messages that arrive together in the order of the subscriptions."""
    node = kind(context=make_node().context, enable_rosout=False)
    topics = [subscription.topic_name for subscription in node.subscriptions]
    node.destroy_node()
    assert topics.index(image) < next(i for i, name in enumerate(topics) if "camera_info" in name)


@pytest.mark.parametrize("kind", [BackgroundNode, StereoDepthNode])
def test_a_remapping_of_the_images_holds_for_compressed_ones(
    kind: type[CardboxNode], make_node: Callable[..., Any]
) -> None:
    place = "left/" if kind is StereoDepthNode else ""
    for old, new in (
        (f"{place}image_raw", "/eye/image/compressed"),
        (f"{place}image_raw/compressed", "/eye/image"),
    ):
        words = ["--ros-args", "-r", f"{old}:=/eye/image", "-p", "image_transport:=compressed"]
        node = kind(context=make_node().context, enable_rosout=False, cli_args=words)
        topics = [subscription.topic_name for subscription in node.subscriptions]
        node.destroy_node()
        assert new in topics


def test_a_camera_info_that_was_latched_before_is_received(make_node: Callable[..., Any]) -> None:
    camera = make_node()
    infos = camera.create_publisher(CameraInfo, "camera_info", qos.LATCHED)
    infos.publish(camera_info_message(Header(frame_id="eye"), CAMERA))
    node = CardboxNode("tested", context=camera.context, enable_rosout=False)
    received: list[str] = []
    node.subscribe_info("camera_info", lambda message, _: received.append(message.header.frame_id))
    executor = SingleThreadedExecutor(context=camera.context)
    executor.add_node(node)
    end = time.monotonic() + 30.0
    while not received and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    node.destroy_node()
    assert received == ["eye"]


@pytest.mark.parametrize("info_stamp_s", [1, 2, 3])
def test_only_the_image_of_the_first_camera_info_is_kept_for_it(
    info_stamp_s: int, make_node: Callable[..., Any], hands: Any
) -> None:
    delivered: list[int] = []
    node = CardboxNode("tested", hands, context=make_node().context, enable_rosout=False)
    CameraImages(
        node,
        "raw",
        lambda _: None,
        lambda header, *_: delivered.append(header.stamp.sec),
    )

    def give(stamp_s: int) -> None:
        header = Header(stamp=Time(sec=stamp_s))
        image = image_message(header, np.zeros((120, 160), np.uint8), "mono8")
        hands.give("/image_raw", image)

    give(1)
    give(2)
    hands.give("/camera_info", camera_info_message(Header(stamp=Time(sec=info_stamp_s)), CAMERA))
    give(4)
    hands.give("/camera_info", camera_info_message(Header(stamp=Time(sec=4)), CAMERA))
    node.destroy_node()
    assert delivered == ([2, 4] if info_stamp_s == 2 else [4])


# DDS latches nothing of a publisher of best effort.
HALF_LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


@pytest.mark.parametrize(
    ("profile", "count"), [(qos.LATCHED, 1), (qos.CAMERA, 0), (HALF_LATCHED, 0)]
)
def test_a_camera_info_that_was_latched_before_the_node_is_used(
    profile: QoSProfile, count: int, make_node: Callable[..., Any]
) -> None:
    """The node asks only publishers that latch, since others would report a mismatch."""
    driver = make_node(name="driver")
    mismatches: list[str] = []
    events = qos.publisher_events("/camera_info", mismatches.append)
    publisher = driver.create_publisher(CameraInfo, "/camera_info", profile, event_callbacks=events)
    publisher.publish(camera_info_message(Header(), CAMERA))
    found: list[Any] = []
    node = CardboxNode("tested", context=driver.context, enable_rosout=False)
    CameraImages(node, "raw", found.append, lambda *_: None)
    executor = SingleThreadedExecutor(context=driver.context)
    for one in (driver, node):
        executor.add_node(one)
    deadline_s = time.monotonic() + (20.0 if count else 4.0)
    while len(found) < max(count, 1) and time.monotonic() < deadline_s:
        executor.spin_once(0.1)
    executor.shutdown()
    node.destroy_node()
    assert (len(found), mismatches) == (count, [])


@pytest.mark.parametrize("first", [qos.LATCHED, HALF_LATCHED])
def test_camera_info_of_any_quality_of_service_is_used_without_a_warning(
    first: QoSProfile, make_node: Callable[..., Any], capfd: pytest.CaptureFixture[str]
) -> None:
    """One publisher latches, and a volatile one of best effort sends beside it."""
    driver = make_node(name="driver")
    profiles = first, qos.SENSOR_DATA
    senders = [driver.create_publisher(CameraInfo, "/camera_info", one) for one in profiles]
    received = set[str]()
    node = CardboxNode("tested", context=driver.context, enable_rosout=False)
    node.subscribe_info("camera_info", lambda message, _: received.add(message.header.frame_id))
    executor = SingleThreadedExecutor(context=driver.context)
    for one in (driver, node):
        executor.add_node(one)
    deadline_s, ticks = time.monotonic() + 20.0, 0
    while (len(received) < 2 or ticks < 30) and time.monotonic() < deadline_s:
        for number, sender in enumerate(senders):
            sender.publish(camera_info_message(Header(frame_id=f"eye {number}"), CAMERA))
        executor.spin_once(0.1)
        ticks += 1
        time.sleep(0.05)
    executor.shutdown()
    warnings = node.diagnostics._remarks()
    node.destroy_node()
    assert received == {"eye 0", "eye 1"}
    told = [line for line in capfd.readouterr().err.splitlines() if "[tested]" in line]
    assert not warnings and not told


@pytest.mark.parametrize("is_zoom", [True, False])
def test_a_calibration_that_the_images_contradict_is_told_and_not_used(
    is_zoom: bool, make_node: Callable[..., Any], hands: Any
) -> None:
    """Background and detector get images and calibration by this way."""
    node = CardboxNode("tested", hands, context=make_node().context, enable_rosout=False)
    focal_px: list[float] = []
    images = CameraImages(node, "raw", lambda c: focal_px.append(c.k[0, 0]), lambda *_: None)
    wall = np.random.default_rng(1).uniform(50, 200, (12, 16))
    near = np.kron(wall[2:-2, 3:-3], np.ones((15, 16)))[:120, :160]
    far = np.kron(wall, np.ones((10, 10)))
    for number in range(3 * LASTING):
        header, is_new = Header(stamp=Time(sec=1 + number)), number > LASTING
        seen = near if is_new and is_zoom else far
        hands.give("/image_raw", image_message(header, seen.astype(np.uint8), "mono8"))
        focal = 240.0 if is_new else 150.0
        info = camera_info_message(header, Camera(160, 120, focal, focal, 79.5, 59.5))
        hands.give("/camera_info", info)
    told = " ".join(images.remarks().values())
    node.destroy_node()
    assert focal_px == ([150.0, 240.0] if is_zoom else [150.0])
    assert is_zoom or (
        "but the images on /image_raw have not" in told and "start this node" in told
    )


def test_of_cameras_that_take_turns_on_a_topic_one_is_used(
    make_node: Callable[..., Any], hands: Any
) -> None:
    node = CardboxNode("tested", hands, context=make_node().context, enable_rosout=False)
    used: list[int] = []
    images = CameraImages(
        node, "raw", lambda _: None, lambda _, image, __: used.append(image[0, 0])
    )
    for number in range(12):
        header = Header(stamp=Time(sec=1 + number), frame_id="left" if number % 2 else "right")
        focal = 200.0 if number % 2 else 150.0
        info = camera_info_message(header, Camera(160, 120, focal, focal, 79.5, 59.5))
        hands.give("/camera_info", info)
        image = np.full((120, 160), 50 if number % 2 else 200, np.uint8)
        hands.give("/image_raw", image_message(header, image, "mono8"))
    told = images.remarks()["frames"]
    node.destroy_node()
    # The first of the second camera shows that there is one.
    assert used == [200, 50, 200, 200, 200, 200, 200]
    assert "frame left are left out" in told and "/image_raw" in told
