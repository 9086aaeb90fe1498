"""The outputs of the initializer's guidance, without other nodes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.guidance import GOOD, Prompt
from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.nodes.initializer_node import GuideOutputs
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters

CAMERA = Camera(80, 60, 80.0, 80.0, 39.5, 29.5)
ASKED = Prompt("front", "Face the camera", 2, "face the camera, arms hanging")
SILHOUETTE = image_message(Header(), np.zeros((60, 80), np.uint8), "mono8")


class Node:
    """Records published messages, and has one subscriber per topic or none."""

    def __init__(self, subscribers: int = 1) -> None:
        self.subscribers = subscribers
        self.sent: dict[str, list[Any]] = {}

    def advertise(self, _: Any, topic: str, profile: Any) -> Any:
        sent = self.sent[topic] = []
        return SimpleNamespace(publish=sent.append, get_subscription_count=lambda: self.subscribers)

    def texts(self, topic: str) -> list[str]:
        return [message.data for message in self.sent[topic]]


def outputs(node: Any) -> GuideOutputs:
    return GuideOutputs(node)


def test_details_go_to_the_status_and_few_words_to_the_loudspeaker() -> None:
    node = Node()
    guide = outputs(node)
    for step in (
        ASKED,
        ASKED._replace(left_s=1),
        Prompt("front", "Good.", None, "captured 5", GOOD),
    ):
        guide.show(step)
    guide.end("measured; iou 0.9", "Thank you. Done.")
    assert node.texts("~/say") == ["Face the camera", "1", "Good.", "Thank you. Done."]
    assert node.texts("~/status") == [
        "front: face the camera, arms hanging: 2",
        "front: face the camera, arms hanging: 1",
        "front: captured 5",
        "measured; iou 0.9",
    ]
    assert node.texts("~/guiding") == [False, True, False]


def test_an_image_is_drawn_on_for_a_subscriber_only() -> None:
    settings = InitializerParameters()
    wall = np.full((60, 80, 3), (20, 40, 60), np.uint8)
    other = np.zeros((30, 40), np.uint8)
    corners = []
    for seen in (None, image_message(Header(), wall), image_message(Header(), other)):
        node = Node()
        guide = outputs(node)
        guide.draw(SILHOUETTE, seen, CAMERA, settings)
        assert not node.sent["overlay"], "nobody is guided yet"
        guide.show(ASKED)
        guide.draw(SILHOUETTE, seen, CAMERA, settings)
        (image,) = node.sent["overlay"]
        corners.append(list(image.data[-3:]))
    # The image is darkened without a person, and an image of another size is not used.
    assert corners == [[0, 0, 0], [10, 20, 30], [0, 0, 0]]
    node = Node(subscribers=0)
    guide = outputs(node)
    guide.show(ASKED)
    guide.draw(SILHOUETTE, None, CAMERA, settings)
    assert not node.sent["overlay"]
