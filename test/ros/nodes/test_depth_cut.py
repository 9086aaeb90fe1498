"""Silhouettes are cut out by the depth image of the same time, and faults are reported."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import EncodingError
from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.nodes.depth_input import DepthCut

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)


class Node:
    """Replaces the background node: records subscriptions and missing inputs."""

    def __init__(self) -> None:
        self.heard: dict[str, Any] = {}
        self.waits: list[str] = []
        self.diagnostics = SimpleNamespace(wait_for=self.waits.append)

    def resolve(self, topic: str) -> str:
        return f"/{topic}"

    def subscribe_info(self, topic: str, callback: Any) -> None:
        self.subscribe(None, topic, callback, None)

    def subscribe(self, kind: Any, topic: str, callback: Any, profile: Any) -> None:
        self.heard[topic] = callback


def header(second: int) -> Header:
    return Header(frame_id="eye", stamp=Time(sec=second))


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def sent() -> list[tuple[Header, np.ndarray]]:
    return []


@pytest.fixture
def cut(node: Node, sent: list[tuple[Header, np.ndarray]]) -> DepthCut:
    return DepthCut(node, "depth", lambda head, silhouette, *_: sent.append((head, silhouette)))  # type: ignore[arg-type]


def test_each_image_is_cut_out_by_its_own_depth(
    node: Node, cut: DepthCut, sent: list[tuple[Header, np.ndarray]]
) -> None:
    for second, rows in ((1, 10), (2, 20)):
        depth = np.full((48, 64), 3000, np.uint16)
        depth[:rows] = 1500
        node.heard["depth"](image_message(header(second), depth, "16UC1"), 1)
        cut.add(header(second), CAMERA, 2.0, 1)
    assert [head.stamp.sec for head, _ in sent] == [1, 2]
    assert [np.count_nonzero(silhouette) for _, silhouette in sent] == [640, 1280]


def test_without_depth_images_it_says_what_it_waits_for(
    node: Node, cut: DepthCut, sent: list[tuple[Header, np.ndarray]]
) -> None:
    for second in range(1, 6):
        cut.add(header(second), CAMERA, 2.0, 1)
    assert sent == []
    assert node.waits[-1] == "depth images on /depth"


def test_what_is_no_depth_is_refused_by_its_topic(node: Node, cut: DepthCut) -> None:
    grey = np.zeros((48, 64), np.uint8)
    node.heard["depth"](image_message(header(1), grey, "mono8"), 1)
    with pytest.raises(EncodingError, match=r"/depth: .*'mono8' .*16UC1"):
        cut.add(header(1), CAMERA, 2.0, 1)
