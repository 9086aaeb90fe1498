"""Depth images on a topic, converted to the view of a camera at the same position."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import (
    DepthImage,
    as_seen_by,
    at_size,
    depth_from_image,
)
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

_PACKED = "/compressedDepth"


class DepthInput:
    """Subscribes to depth images, raw or packed, and to their CameraInfo if there is one.

    Attributes:
        camera: camera that measured the depth; None for that of :meth:`seen_by`.
    """

    def __init__(self, node: CardboxNode, topic: str, heard: Callable[[Any, int], None]) -> None:
        """Subscribe with ``node`` to ``topic``; ``heard`` receives messages and send times.

        If the topic ends in ``/compressedDepth``, its messages are those of image_transport. The
        CameraInfo is on ``TOPIC/camera_info``, where TOPIC is the name without this ending.
        """
        self.camera: Camera | None = None
        kind: Any = CompressedImage if topic.endswith(_PACKED) else Image
        info = f"{topic.removesuffix(_PACKED)}/camera_info"
        node.subscribe_info(info, self._on_info)
        node.subscribe(kind, topic, heard, qos.SENSOR_DATA)

    def _on_info(self, message: CameraInfo, _: int) -> None:
        self.camera = conversions.depth_camera_of(message)

    def seen_by(self, camera: Camera, message: Any) -> DepthImage:
        """Return the depth (H, W), metres, of a message as ``camera`` sees it.

        Raises:
            EncodingError: the encoding of the message is not one of depth.
        """
        depth_m = depth_from_image(message)
        if self.camera is None:
            return at_size(depth_m, camera.width, camera.height)
        return as_seen_by(depth_m, self.camera, camera)
