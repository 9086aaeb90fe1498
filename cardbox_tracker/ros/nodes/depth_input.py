"""Depth images on a topic, as another camera at the same place sees them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.depth_image import (
    DepthImage,
    as_seen_by,
    at_size,
    depth_from_image,
)

_PACKED = "/compressedDepth"


class DepthInput:
    """Subscribes to depth images, raw or packed, and to their CameraInfo if there is one.

    Attributes:
        camera: that measured the depth; None: the one that is asked for in :meth:`seen_by`.
    """

    def __init__(self, node: CardboxNode, topic: str, heard: Callable[[Any, int], None]) -> None:
        """Subscribe with ``node`` to ``topic``; ``heard`` takes a message and when it was sent.

        A topic whose name ends in ``/compressedDepth`` has messages of image_transport's plugin.
        The CameraInfo is on ``TOPIC/camera_info``, of the topic without that.
        """
        self.camera: Camera | None = None
        kind: Any = CompressedImage if topic.endswith(_PACKED) else Image
        info = f"{topic.removesuffix(_PACKED)}/camera_info"
        node.subscribe(CameraInfo, info, self._on_info, qos.SENSOR_DATA)
        node.subscribe(kind, topic, heard, qos.SENSOR_DATA)

    def _on_info(self, message: CameraInfo, _: int) -> None:
        self.camera = conversions.depth_camera_of(message)

    def seen_by(self, camera: Camera, message: Any) -> DepthImage:
        """Return the depth (H, W), metres, of a message as ``camera`` sees it.

        Raises:
            EncodingError: the message has no depth.
        """
        depth_m = depth_from_image(message)
        if self.camera is None:
            return at_size(depth_m, camera.width, camera.height)
        return as_seen_by(depth_m, self.camera, camera)
