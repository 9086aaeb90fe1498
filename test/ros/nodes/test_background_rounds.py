"""A recording that is played again and again while its background is not learned."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message
from cardbox_tracker.ros.nodes.background_node import BackgroundNode

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
LEARN = 6


@pytest.fixture
def played(bus: Any) -> Any:
    """Return a function that plays images of a brightness at 10 Hz, from 1 s on."""
    bus.start(BackgroundNode, learn_images=LEARN, learning="always")
    bus.send("/camera_info", camera_info_message(Header(frame_id="eye"), CAMERA))

    def play(images: int, brightness: int = 90) -> dict[str, str]:
        for number in range(images):
            stamp = Time(sec=1 + number // 10, nanosec=number % 10 * 10**8)
            pixels = np.full((240, 320), brightness, np.uint8)
            header = Header(frame_id="eye", stamp=stamp)
            bus.send("/image_raw", image_message(header, pixels, "mono8"))
        return {value.key: value.value for value in bus.tick().values}

    return play


def test_a_recording_of_three_images_is_learned_in_several_rounds(bus: Any, played: Any) -> None:
    assert played(3)["background learned from"] == f"3/{LEARN}"
    for _ in range(3):
        played(3)
    assert bus.sent["/silhouette"]


def test_a_recording_that_starts_over_restarts_unfinished_learning(bus: Any, played: Any) -> None:
    node = bus._nodes[0]
    # Learning takes longer than a round, as where something moves.
    node._pipeline.learning.has_enough = lambda: False
    assert played(20)["background learned from"] == f"20/{LEARN}"
    assert played(1)["background learned from"] == f"1/{LEARN}"
