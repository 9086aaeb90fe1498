"""Depth images on a topic in the view of a camera beside it, and silhouettes cut out by them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import DepthImage, as_seen_by, at_size, depth_from_image
from cardbox_tracker.camera.pairing import TOLERANCE_NS, Arrivals
from cardbox_tracker.common.errors import EncodingError
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.segmentation.silhouettes import silhouette_within

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
        """Return the depth (H, W), metres, of a message as ``camera`` sees it."""
        depth_m = depth_from_image(message)
        if self.camera is None:
            return at_size(depth_m, camera.width, camera.height)
        return as_seen_by(depth_m, self.camera, camera)


Send = Callable[[Header, ImageArray, Camera, int], None]
"""Callback that receives header, silhouette, camera and the later of both send times, ns."""


class DepthCut:
    """Pairs images with depth, the last ``depth_m``, and cuts out pixels nearer than a limit."""

    def __init__(self, node: CardboxNode, topic: str, send: Send) -> None:
        self._node, self._topic = node, node.resolve(topic)
        self._send = send
        self.depth_m: DepthImage = np.empty((0, 0), np.float32)
        self._arrivals: Arrivals[tuple[Any, ...]] = Arrivals(2, TOLERANCE_NS)
        self._input = DepthInput(node, topic, self._on_depth)

    def add(self, header: Header, camera: Camera, within_m: float, sent_ns: int) -> None:
        """Add an image of ``camera``, in which pixels nearer than ``within_m`` are the person."""
        self._add(0, header, (header, camera, within_m, sent_ns))

    def _on_depth(self, message: Any, sent_ns: int) -> None:
        self._add(1, message.header, (message, sent_ns))

    def _add(self, number: int, header: Header, taken: tuple[Any, ...]) -> None:
        self._arrivals.add(number, conversions.stamp_ns(header.stamp), taken)
        for seen, measured in self._arrivals.sets():
            if seen is None:
                continue
            if measured is None:
                self._node.diagnostics.wait_for(f"depth images on {self._topic}")
                continue
            (header, camera, within_m, seen_ns), (message, measured_ns) = seen, measured
            try:
                self.depth_m = self._input.seen_by(camera, message)
            except EncodingError as error:
                # The node would otherwise name the topic of the message that completed the set.
                raise EncodingError(f"{self._topic}: {error}") from None
            silhouette = silhouette_within(self.depth_m, within_m)
            self._send(header, silhouette, camera, max(seen_ns, measured_ns))
