"""The initializer measures the distance with depth images, and reports missing ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult
from cardbox_tracker.measuring.scale import scaled
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.nodes.reference_capture import DepthDistance, ReferenceCapture
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.4)
SECOND = 1_000_000_000


class Node:
    """Replaces the initializer: records subscriptions."""

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Any, int], None]] = {}

    def resolve(self, topic: str) -> str:
        return f"/{topic}"

    def subscribe(self, kind: Any, topic: str, callback: Any, profile: Any) -> None:
        self.heard[topic] = callback

    def subscribe_info(self, topic: str, callback: Any) -> None:
        self.subscribe(None, topic, callback, None)

    def see(self, second: int, depth_m: float) -> None:
        """Receive a depth image of uniform depth at twice the working resolution."""
        pixels = np.full((240, 320), 1000 * depth_m, np.uint16)
        header = Header(frame_id="eye", stamp=Time(sec=second))
        self.heard["depth"](image_message(header, pixels, "16UC1"), 1)


def silhouette_of(name: str) -> np.ndarray:
    cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
    image = np.zeros((120, 160), np.uint8)
    for patch in cost.corners(np.append(reference_posture(name), [0.0, 0.0])):
        cv2.fillConvexPoly(image, np.round(CAMERA.project(patch)).astype(np.int32), 255)
    return image


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def distance(node: Node) -> DepthDistance:
    references = ReferenceCapture("/silhouette")
    references.captured = {name: silhouette_of(name) for name in ("front", "side", "arms")}
    return DepthDistance(node, "depth", references, lambda: CAMERA)  # type: ignore[arg-type]


def measure(at: InitializationConfig, _: bool) -> InitializationResult:
    """Replace the camera's measurement; any distance gives the same silhouettes."""
    body = scaled(BODY, at.distance_m / BODY.placement.distance_m)
    return InitializationResult(body, {"front": 0.9}, {}, {})


def test_the_distance_is_that_of_the_depth_images(node: Node, distance: DepthDistance) -> None:
    for second, name in ((1, "front"), (9, "arms")):
        node.see(second, BODY.placement.distance_m - 0.1)
        distance.check()
        distance.capture(name, second * SECOND)
    found = distance.measure(measure, InitializationConfig(distance_m=1.6)).body
    assert found.placement.distance_m == pytest.approx(BODY.placement.distance_m, abs=0.06)


def test_what_is_missing_is_said(node: Node, distance: DepthDistance) -> None:
    with pytest.raises(InitializationError, match=r"no depth image .*/depth"):
        distance.check()
    node.see(1, 1.9)
    with pytest.raises(InitializationError, match=r"'front': no depth image .*/depth"):
        distance.capture("front", 9 * SECOND)
    distance.capture("front", SECOND)
    with pytest.raises(InitializationError, match=r"no depth image.* front and"):
        distance.measure(measure, InitializationConfig())
