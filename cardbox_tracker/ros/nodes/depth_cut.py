"""The background node's silhouettes where they come from depth images: nothing is learned."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from std_msgs.msg import Header

from cardbox_tracker.errors import EncodingError
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.nodes.depth_input import DepthInput
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.depth_silhouette import silhouette_within
from cardbox_tracker.vision.pairing import TOLERANCE_NS, Arrivals


class Taken(NamedTuple):
    """An image, or a depth image, of one time.

    Attributes:
        message: header of the image, or the depth image.
        camera: of the image; None of a depth image.
        within_m: how near is near, at the time of the image.
        sent_ns: when it was sent.
    """

    message: Any
    camera: Camera | None
    within_m: float
    sent_ns: int


Send = Callable[[Header, ImageArray, Camera, int], None]
"""Takes header, silhouette, camera, and when the later of image and depth was sent."""


class DepthCut:
    """Pairs images with depth images and cuts out whoever is near enough."""

    def __init__(self, node: CardboxNode, topic: str, send: Send) -> None:
        """Subscribe with ``node`` to depth images on ``topic``; ``send`` takes silhouettes."""
        self._node, self._topic = node, node.resolve(topic)
        self._send = send
        self._arrivals: Arrivals[Taken] = Arrivals(2, TOLERANCE_NS)
        self._input = DepthInput(node, topic, self._on_depth)

    def add(self, header: Header, camera: Camera, within_m: float, sent_ns: int) -> None:
        """Take note of an image of ``camera``, of which whoever is ``within_m`` is wanted."""
        stamp_ns = conversions.stamp_ns(header.stamp)
        self._add(0, stamp_ns, Taken(header, camera, within_m, sent_ns))

    def _on_depth(self, message: Any, sent_ns: int) -> None:
        stamp_ns = conversions.stamp_ns(message.header.stamp)
        self._add(1, stamp_ns, Taken(message, None, 0.0, sent_ns))

    def _add(self, number: int, stamp_ns: int, taken: Taken) -> None:
        self._arrivals.add(number, stamp_ns, taken)
        for seen, measured in self._arrivals.sets():
            if seen is None:
                continue
            if measured is None:
                self._node.diagnostics.wait_for(f"depth images on {self._topic}")
                continue
            assert seen.camera is not None
            try:
                depth_m = self._input.seen_by(seen.camera, measured.message)
            except EncodingError as error:
                # Either message may have completed the set.
                raise EncodingError(f"{self._topic}: {error}") from None
            silhouette = silhouette_within(depth_m, seen.within_m)
            sent_ns = max(seen.sent_ns, measured.sent_ns)
            self._send(seen.message, silhouette, seen.camera, sent_ns)
