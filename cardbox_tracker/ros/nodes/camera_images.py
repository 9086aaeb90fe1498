"""The images that a node receives from a camera, and the silhouettes of them that it sends."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.calibration_watch import CalibrationWatch
from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.encodings import Levels
from cardbox_tracker.camera.exposure import exposure_problem
from cardbox_tracker.camera.frames import OneFrame
from cardbox_tracker.camera.stamps import StampOrder
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.publishers import SinglePublisher

Deliver = Callable[[Header, ImageArray, int], None]
"""Callback that receives header, image (H, W) or (H, W, 3), bgr, and its send time, ns."""


def image_topic(node: CardboxNode, topic: str, transport: str) -> tuple[str, Any]:
    """Return the full name and the type of the images; a remapping of ``topic`` holds for both."""
    if transport == "compressed":
        return node.resolve(f"{node.resolve(topic)}/compressed"), CompressedImage
    return node.resolve(topic), Image


class CameraImages:
    """Subscribes to images, raw or compressed, and to their CameraInfo.

    Attributes:
        topic: full name of the topic of the images.
        info_topic: full name of the topic of their CameraInfo.
        watch: follows the calibration.
        info: CameraInfo in use; None before the first valid one.
        order: relation of the stamp of the last delivered image to the one before.
        image_bytes: size of the data of the last image.
    """

    def __init__(
        self,
        node: CardboxNode,
        transport: str,
        changed: Callable[[Calibration], None],
        deliver: Deliver,
        roll_deg: float = 0.0,
    ) -> None:
        """Subscribe with ``node``, ``raw`` or ``compressed``, and report on its diagnostics.

        ``changed`` is called with the first calibration and others that last, ``deliver`` with each
        image once it is known; ``roll_deg`` is that of the camera.
        """
        self._node = node
        self._changed, self._deliver = changed, deliver
        self.topic, kind = image_topic(node, "image_raw", transport)
        self.info_topic = node.resolve("camera_info")
        self.watch = CalibrationWatch(self.info_topic, self.topic, math.radians(roll_deg))
        self.info: CameraInfo | None = None
        self.order = StampOrder.NEXT
        self.image_bytes = 0
        self._levels, self._frames = Levels(), OneFrame()
        self._image: ImageArray | None = None
        self._early: tuple[Image | CompressedImage, int] | None = None
        self._single = SinglePublisher(node, (self.topic, self.info_topic))
        # Of messages that arrive together, those of the first subscription are taken first.
        # While the node works, only the newest image is kept.
        node.subscribe(kind, self.topic, self.on_image, qos.NEWEST)
        node.subscribe_info("camera_info", self.on_info)
        node.diagnostics.source = f"images on {self.topic}"
        node.diagnostics.wait_for(
            f"images on {self.topic} and their CameraInfo on {self.info_topic}"
        )

    def on_info(self, message: CameraInfo, _: int) -> None:
        """Use a CameraInfo if it is the first valid one, or lasts."""
        if message.header.frame_id.lstrip("/") in self._frames.others:
            return
        before, old = self.watch.remark, self.watch.current
        changed = self.watch.see(message)
        if self.watch.remark not in ("", before):
            self._node.diagnostics.say("CameraInfo", self.watch.remark, warning=True)
        calibration = self.watch.current
        if not changed or calibration is None:
            return
        if old is not None and not old.is_resized(calibration):
            self._node.get_logger().warning(
                f"the CameraInfo on {self.info_topic} has changed for good, to {calibration}"
            )
        if self.watch.doubt:
            self._node.get_logger().warning(self.watch.doubt)
        self.info = message
        self._changed(calibration)
        self._node.diagnostics.wait_for(f"images on {self.topic}")
        early, self._early = self._early, None
        if early is not None and early[0].header.stamp == message.header.stamp:
            self._use(*early, calibration)

    def on_image(self, message: Image | CompressedImage, sent_ns: int) -> None:
        """Deliver an image if its stamp can be used and the calibration is known."""
        if not self._frames.takes(message.header.frame_id):
            return
        order = self._node.diagnostics.arrived(conversions.stamp_ns(message.header.stamp))
        if not order.is_usable:
            return
        self.order, self.image_bytes = order, len(message.data)
        calibration = self.watch.current
        if calibration is None:
            # Its CameraInfo may have arrived with it.
            self._early = message, sent_ns
            if not self.watch.seen:
                self._node.diagnostics.wait_for(
                    f"the CameraInfo on {self.info_topic} for the images on {self.topic}"
                )
            return
        self._use(message, sent_ns, calibration)

    def _use(
        self, message: Image | CompressedImage, sent_ns: int, calibration: Calibration
    ) -> None:
        most = conversions.most_pixels_of(calibration)
        changes = self._levels.changes
        image = conversions.image_of(message, most, self._levels)
        if self._levels.changes > changes:
            if self._levels.text:
                self._node.get_logger().info(f"{self.topic}: {self._levels.text}")
            if changes:  # what was learned has another scale
                self._changed(calibration)
        height, width = image.shape[:2]
        calibration.check_shape(width, height, self.topic, self.info_topic)
        self.watch.images.look(image)
        self._image = image
        # TF knows neither an empty name nor one with a slash before it.
        frame_id = message.header.frame_id.lstrip("/")
        message.header.frame_id = frame_id or calibration.frame_id
        self._deliver(message.header, image, sent_ns)

    def remarks(self) -> dict[str, str]:
        """Return warnings about publishers, calibration and exposure, by kind."""
        found = {"": self.watch.remark, "calibration": self.watch.doubt}
        problem = "" if self._image is None else exposure_problem(self._image)
        found["frames"] = self._frames.remark(self.topic)
        found["exposure"] = problem and f"{self.topic}: {problem}"
        return self._single.remarks() | {kind: text for kind, text in found.items() if text}


class SilhouetteOutputs:
    """Publishes silhouettes, images and camera; ``covered`` is the last one's foreground share."""

    def __init__(self, node: CardboxNode) -> None:
        self.covered = 0.0
        self._node = node
        self._silhouettes = node.advertise_inside(Image, "silhouette", qos.SILHOUETTE)
        self._images = node.advertise_inside(Image, "silhouette/image", qos.SILHOUETTE)
        self._infos = node.advertise_inside(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)

    def send_image(self, header: Header, image: ImageArray) -> None:
        """Publish an image (H, W) or (H, W, 3) before its silhouette; the tracker pairs both."""
        if self._images.get_subscription_count():
            self._images.publish(conversions.image_message(header, image))

    def send(
        self, header: Header, silhouette: ImageArray, camera: Camera, info: CameraInfo | None
    ) -> None:
        """Publish a silhouette (H, W), 0 or 255, and then its calibration."""
        self._silhouettes.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, camera, info))
        self.covered = np.count_nonzero(silhouette) / silhouette.size
