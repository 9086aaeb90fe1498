"""Silhouettes survive a restart, a wrong CameraInfo, a second camera, and a person in view."""

from __future__ import annotations

import itertools
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.runtime import qos

LEARN_IMAGES = 12
RESTARTS = 2


class Camera:
    """A camera with a person who sways by some millimetres, and its background node."""

    def __init__(self, graph: Any, scene: Any) -> None:
        self.graph, self.scene = graph, scene
        self.silhouettes = graph.collect(Image, "silhouette")
        self.shown: dict[tuple[int, int], Any] = {}
        self._starts = itertools.count()

    def start(self, **parameters: Any) -> None:
        graph = self.graph
        # DDS lists a killed node for a while, so the new node gets its own topics.
        self.topic = f"/camera_{next(self._starts)}/image_raw"
        info = self.topic.replace("image_raw", "camera_info")
        self.images = graph.node.create_publisher(Image, self.topic, qos.CAMERA)
        self.infos = graph.node.create_publisher(CameraInfo, info, qos.CAMERA)
        self.ranges = None
        if "depth" in parameters:
            self.ranges = graph.node.create_publisher(Image, parameters["depth"], qos.CAMERA)
        names = ("-r", f"image_raw:={self.topic}", "-r", f"camera_info:={info}")
        self.process = graph.start(
            "background", "--ros-args", *names, learn_images=LEARN_IMAGES, **parameters
        )
        ends = [end for end in (self.images, self.infos, self.ranges) if end is not None]
        graph.wait(lambda: all(end.get_subscription_count() == 1 for end in ends), "the node")
        graph.spin(0.3)
        self.silhouettes.clear()

    def kill(self) -> None:
        """Kill the node like a crash; its exit code is not checked."""
        self.graph.processes.remove(self.process)
        self.process.stop(signal.SIGKILL)

    def show(self, posture: str | None, *, focal_px: float = 300.0) -> None:
        """Publish one image and its CameraInfo."""
        camera = self.scene.camera
        header = Header(frame_id="optical", stamp=self.graph.next_stamp())
        place: Any = None
        if posture is not None:
            place = reference_posture(posture)
            place[0] = self.scene.body.placement.lateral_m + 0.012 * np.sin(len(self.shown) / 5)
        truth = self.scene.silhouette(place)
        self.shown[header.stamp.sec, header.stamp.nanosec] = truth > 0
        info = camera_info_message(header, camera)
        info.k[0] = info.k[4] = focal_px
        self.infos.publish(info)
        pixels = np.where(truth > 0, 190.0, 90.0) + np.random.default_rng().normal(
            0, 2, truth.shape
        )
        self.images.publish(image_message(header, np.clip(pixels, 0, 255).astype(np.uint8)))
        if self.ranges is not None:
            depth_mm = np.where(truth > 0, 2000, 4000).astype(np.uint16)
            self.ranges.publish(image_message(header, depth_mm, "16UC1"))

    def iou(self, message: Any) -> float:
        truth = self.shown[message.header.stamp.sec, message.header.stamp.nanosec]
        found = np.frombuffer(message.data, np.uint8).reshape(truth.shape) > 0
        return float(np.count_nonzero(found & truth) / np.count_nonzero(found | truth))

    def until_silhouettes(self, posture: str | None, count: int = 1) -> tuple[int, list[Any]]:
        """Show images until ``count`` more silhouettes; return their number and silhouettes."""
        first, shown = len(self.silhouettes), 0

        def came() -> bool:
            nonlocal shown
            self.show(posture)
            shown += 1
            self.graph.spin(0.05)
            return len(self.silhouettes) >= first + count

        self.graph.wait(came, f"{count} silhouettes")
        return shown, self.silhouettes[first:]


@pytest.fixture
def camera(own_graph: Any, scene: Any) -> Camera:
    return Camera(own_graph, scene)


def test_with_depth_images_nothing_has_to_be_learned(camera: Camera) -> None:
    camera.start(depth="/range/image_raw", within_m=3.0)
    # The person is in view from the first image on.
    shown, silhouettes = camera.until_silhouettes("front", 3)
    assert shown < LEARN_IMAGES
    assert min(camera.iou(message) for message in silhouettes) > 0.95
    _, nobody = camera.until_silhouettes(None, 5)
    assert not np.any(np.frombuffer(nobody[-1].data, np.uint8))
    camera.ranges, ranged = None, set(camera.shown)
    for _ in range(20):
        camera.show("front")
        camera.graph.spin(0.05)
    stamps = [message.header.stamp for message in camera.silhouettes]
    assert {(stamp.sec, stamp.nanosec) for stamp in stamps} <= ranged
    assert camera.graph.diagnosis("background", "waiting for depth images on /range/image_raw")


def test_a_good_background_is_kept(camera: Camera, tmp_path: Path) -> None:
    graph, file = camera.graph, tmp_path / "background.npz"
    camera.start(background_file=file)
    camera.until_silhouettes(None)
    assert file.exists()
    _, silhouettes = camera.until_silhouettes("front", 5)
    before = np.mean([camera.iou(message) for message in silhouettes[1:]])
    assert before > 0.95

    # The first fault is one wrong CameraInfo.
    camera.show("front", focal_px=301.0)
    _, silhouettes = camera.until_silhouettes("front", 5)
    assert min(camera.iou(message) for message in silhouettes) > before - 0.02
    status = graph.diagnosis("background", "that differs from those before")
    assert {value.key: value.value for value in status.values}["ignored CameraInfo"] == "1"

    # The second fault is another camera on the topic.
    second = rclpy.create_node("second_camera", context=graph.context, enable_rosout=False)
    second.create_publisher(Image, camera.topic, qos.CAMERA)
    values = {
        value.key: value.value
        for value in graph.wait(
            lambda: next(
                (
                    status.values
                    for status in [graph.diagnosis("background")]
                    if any("/second_camera" in value.value for value in status.values)
                ),
                None,
            ),
            "the second camera's name",
        )
    }
    assert any("/probe, /second_camera" in value for value in values.values())
    second.destroy_node()

    # The third fault is a crash and a restart with a person in view.
    for _ in range(RESTARTS):
        camera.kill()
        camera.start(background_file=file)
        _, silhouettes = camera.until_silhouettes("front", 3)
        # DDS may take a second to find the restarted node, so images are not counted.
        said = camera.process.text()
        assert "background read from" in said and "learned from" not in said, said
        assert min(camera.iou(message) for message in silhouettes) > before - 0.02


def test_nobody_is_learned_in(camera: Camera) -> None:
    camera.start()
    for _ in range(4 * LEARN_IMAGES):
        camera.show("front")
        camera.graph.spin(0.03)
    camera.graph.diagnosis("background", "something moves in it")
    assert not camera.silhouettes
    camera.until_silhouettes(None)
    _, silhouettes = camera.until_silhouettes("front", 4)
    assert camera.iou(silhouettes[-1]) > 0.95
