"""No publisher, or two, of a topic that one camera should publish are reported with names."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from std_msgs.msg import String

from cardbox_tracker.ros.runtime.publishers import SinglePublisher

WAIT_S = 30.0
PATIENCE, STARTING = 5, 150


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


def test_a_wrong_name_is_reported_with_the_topics_of_the_type(
    make_node: Callable[..., Any],
) -> None:
    node, camera = make_node(), make_node(name="camera")
    node.create_subscription(String, "/kamera/image_raw", print, 1)
    node.create_publisher(String, "/own", 1)
    camera.create_publisher(String, "/overlay", 1)
    camera.create_publisher(String, "/camera/image_raw", 1)
    wait_for(lambda: node.count_publishers("/camera/image_raw") == 1)
    watch = SinglePublisher(node, ("/kamera/image_raw",))
    # Other nodes may start a little later.
    assert [watch.remarks() for _ in range(PATIENCE)] == [{}] * PATIENCE
    ((kind, text),) = watch.remarks().items()
    assert kind == "no publisher of /kamera/image_raw"
    assert "nobody publishes /kamera/image_raw" in text
    assert "/camera/image_raw" in text and "/own" not in text and "/overlay" not in text
    assert "remap" in text
    late = camera.create_publisher(String, "/kamera/image_raw", 1)
    wait_for(lambda: watch.remarks() == {})
    # A publisher that ends is reported as silence of the images.
    camera.destroy_publisher(late)
    wait_for(lambda: node.count_publishers("/kamera/image_raw") == 0)
    assert all(watch.remarks() == {} for _ in range(PATIENCE + 2))


def test_a_camera_that_still_starts_is_not_missing(make_node: Callable[..., Any]) -> None:
    """Other nodes of the launch already make images, none of which is the camera's."""
    node, other = make_node(), make_node(name="background")
    node.create_subscription(String, "/image_raw", print, 1)
    for topic in ("silhouette", "silhouette/image", "overlay", "background/mean"):
        other.create_publisher(String, topic, 1)
    wait_for(lambda: node.count_publishers("/background/mean") == 1)
    watch = SinglePublisher(node, ("/image_raw",))
    assert [watch.remarks() for _ in range(STARTING)] == [{}] * STARTING
    assert "of the same type are: none at all" in watch.remarks()["no publisher of /image_raw"]
