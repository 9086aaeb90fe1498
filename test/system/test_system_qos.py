"""Incompatible publishers and subscribers are reported in the log and the diagnostics."""

from __future__ import annotations

from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import Header

from cardbox_tracker.ros.messages.conversions import image_message
from cardbox_tracker.ros.runtime import qos


def is_reported(graph: Any, words: str) -> bool:
    status = graph.diagnosis("tracker")
    return status.level != DiagnosticStatus.OK and any(
        words in value.value for value in status.values
    )


def test_a_best_effort_silhouette_is_told_with_the_remedy(graph: Any) -> None:
    tracker = graph.start("tracker")
    graph.wait(lambda: graph.node.count_publishers("joint_states") == 1, "the tracker")
    graph.node.create_publisher(Image, "silhouette", qos.SENSOR_DATA)
    words = "incompatible QoS on /silhouette: a publisher offers best effort"
    graph.wait(lambda: words in tracker.text(), "the warning in the log")
    assert "qos_overrides./silhouette.subscription.reliability:=best_effort" in tracker.text()
    graph.wait(lambda: is_reported(graph, words), "the warning in the diagnostics")


def test_a_latched_subscriber_of_joint_states_is_told(graph: Any) -> None:
    tracker = graph.processes[0]
    graph.collect(JointState, "joint_states", qos.LATCHED)
    words = "incompatible QoS on /joint_states: a subscriber asks for latched"
    graph.wait(lambda: words in tracker.text(), "the warning in the log")
    assert "qos_overrides./joint_states.publisher.durability:=transient_local" in tracker.text()
    graph.wait(lambda: is_reported(graph, words), "the warning in the diagnostics")


def test_another_message_type_is_told_with_the_node(graph: Any) -> None:
    tracker = graph.processes[0]
    context = Context()
    rclpy.init(context=context, domain_id=graph.domain)
    other = rclpy.create_node("other", context=context, enable_rosout=False)
    other.create_publisher(CompressedImage, "silhouette", qos.SILHOUETTE)
    words = "another node (/other) publishes /silhouette as sensor_msgs/msg/CompressedImage"
    graph.wait(lambda: words in tracker.text(), "the warning in the log")
    graph.wait(lambda: is_reported(graph, words), "the warning in the diagnostics")
    assert "/joint_states as" not in tracker.text()
    other.destroy_node()
    context.try_shutdown()
    graph.wait(lambda: not is_reported(graph, words), "the end of the warning")


def test_the_remedy_works(graph: Any, scene: Any) -> None:
    """With the override named in the warning, best-effort silhouettes arrive."""
    override = "qos_overrides./eye/silhouette.subscription.reliability"
    tracker = graph.start(
        "tracker", "--ros-args", "-r", "__ns:=/eye", "-p", f"{override}:=best_effort"
    )
    publisher = graph.node.create_publisher(Image, "/eye/silhouette", qos.SENSOR_DATA)
    graph.wait(publisher.get_subscription_count, "the tracker")

    def received() -> bool:
        header = Header(frame_id="eye", stamp=graph.next_stamp())
        publisher.publish(image_message(header, scene.silhouette("front"), "mono8"))
        values = {v.key: v.value for v in graph.diagnosis("eye/tracker").values}
        return int(values["received"]) > 0

    graph.wait(received, "the silhouette")
    assert "incompatible" not in tracker.text()
