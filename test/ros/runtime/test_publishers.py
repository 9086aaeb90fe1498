"""Two publishers of a topic that one camera should publish are named."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from std_msgs.msg import String  # noqa: E402

from cardbox_tracker.ros.runtime.publishers import SinglePublisher  # noqa: E402

WAIT_S = 30.0


def wait_for(condition: Callable[[], Any]) -> Any:
    end = time.monotonic() + WAIT_S
    while not (value := condition()):
        assert time.monotonic() < end, "not in time"
    return value


def test_two_publishers_are_named_until_one_has_gone(make_node: Callable[..., Any]) -> None:
    node, first, second = make_node(), make_node(name="left"), make_node(name="right")
    watch = SinglePublisher(node, ("/image_raw", "/camera_info"))
    first.create_publisher(String, "/image_raw", 1)
    wait_for(lambda: node.count_publishers("/image_raw") == 1)
    assert watch.remarks() == {}
    other = second.create_publisher(String, "/image_raw", 1)
    ((kind, text),) = wait_for(watch.remarks).items()
    assert kind == "publishers of /image_raw"
    assert "/image_raw: /left, /right; expected one" in text
    second.destroy_publisher(other)
    wait_for(lambda: not watch.remarks())
