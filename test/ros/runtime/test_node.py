"""Common behaviour of running nodes."""

from __future__ import annotations

import gc
import time

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode, own_arguments, run


class Nothing:
    """Holds nothing."""

    def close(self) -> None:
        """Release nothing."""


def test_a_running_node_is_not_searched_for_garbage() -> None:
    frozen = []
    gc.unfreeze()
    try:
        assert run(Nothing, [], lambda _: frozen.append(gc.get_freeze_count())) == 0
    finally:
        gc.unfreeze()
    assert frozen[0] > 1000


@pytest.mark.parametrize(
    "arguments",
    [("-p",), ("-p", "bag:=[1"), ("-r",), ("-r", "x"), ("--log-level", "nonsense")],
)
def test_ros_arguments_that_are_none_are_told_in_words(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        own_arguments(["camera", "--list", "--ros-args", *arguments])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith("cannot start: ")
    assert own_arguments(["camera", "--list", "--ros-args", "-p", "a:=1"]) == ["--list"]


@pytest.mark.parametrize("topic", ["/1image", "/image raw", "//image", "/image-raw", ""])
def test_a_topic_that_ros_does_not_allow_is_told(topic: str, ros_domain: int) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = CardboxNode("tested", context=context, enable_rosout=False)
    try:
        with pytest.raises(CardboxError, match="topic"):
            node.advertise(String, topic, qos.RESULT)
    finally:
        node.destroy_node()
        context.try_shutdown()


def test_calls_at_once_wait_for_a_busy_node(ros_domain: int) -> None:
    context, calls = Context(), 300
    rclpy.init(context=context, domain_id=ros_domain)
    node = CardboxNode("tested", context=context, enable_rosout=False)
    node.offer("do", lambda: "done")
    caller = rclpy.create_node("caller", context=context, enable_rosout=False)
    profile = QoSProfile(depth=calls)
    client = caller.create_client(Trigger, "do", qos_profile=profile)
    try:
        assert client.wait_for_service(10.0)
        answers = [client.call_async(Trigger.Request()) for _ in range(calls)]
        executor = SingleThreadedExecutor(context=context)
        for one in (node, caller):
            executor.add_node(one)
        until_s = time.monotonic() + 10.0
        while time.monotonic() < until_s and not all(answer.done() for answer in answers):
            executor.spin_once(0.1)
        assert sum(answer.done() for answer in answers) == calls
    finally:
        caller.destroy_node()
        node.destroy_node()
        context.try_shutdown()
