"""``cardbox call``: call a service of the nodes; PyPI has rclpy but not the command ``ros2``."""

from __future__ import annotations

import time
from collections.abc import Callable

import rclpy
from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.utilities import try_shutdown
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cardbox_tracker.common.errors import CardboxError, cut, quoted
from cardbox_tracker.ros.runtime import qos

_FIND_S = 10.0
_TELL_S = 1.0
_GONE_S = 5.0
_STEP_S = 0.05
_TYPE = "std_srvs/srv/Trigger"


def call_service(service: str, say: Callable[[str], None]) -> str:
    """Call a Trigger service and return its answer; ``say`` gets lines of its node's status.

    Raises CardboxError, with the reason, if it is not available or refuses.
    """
    rclpy.init(args=[])
    try:
        node = rclpy.create_node("cardbox_call", enable_rosout=False)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        client = _client(node, service)
        begun_s, told = time.monotonic(), False
        while not client.service_is_ready():
            waited_s = time.monotonic() - begun_s
            if waited_s > _FIND_S:
                raise CardboxError(_not_found(node, service))
            if waited_s > _TELL_S and not told:
                told = True
                say(f"waiting up to {_FIND_S:g} s for the service {service}")
            executor.spin_once(timeout_sec=_STEP_S)
        status = f"{service.rpartition('/')[0]}/status".lstrip("/")
        topic = f"/{status}" if service.startswith("/") else status
        asked = False

        def show(message: String) -> None:
            # Latched lines from before the call belong to an earlier call.
            if asked:
                say(message.data)

        node.create_subscription(String, topic, show, qos.LATCHED_LINES)
        settled_s = time.monotonic() + 0.3
        while time.monotonic() < settled_s:
            executor.spin_once(timeout_sec=_STEP_S)
        asked = True
        future = client.call_async(Trigger.Request())
        seen_s = time.monotonic()
        while not future.done():
            executor.spin_once(timeout_sec=_STEP_S)
            if client.service_is_ready():
                seen_s = time.monotonic()
            elif time.monotonic() > seen_s + _GONE_S:
                raise CardboxError(f"the node of {service} ended before it answered")
        answer: Trigger.Response = future.result()
    finally:
        try_shutdown()
    if not answer.success:
        raise CardboxError(str(answer.message))
    return str(answer.message)


def _client(node: Node, service: str) -> Client:
    try:
        if not service:
            raise ValueError("the name is empty")
        return node.create_client(Trigger, service)
    except Exception as error:
        # The class of this error depends on the release of rclpy.
        reason = " ".join(str(error).split())
        raise CardboxError(
            f"{quoted(service)} is not a valid name of a service: {cut(reason)}; expected a name "
            "such as initializer/initialize"
        ) from None


def _not_found(node: Node, service: str) -> str:
    own = node.resolve_service_name(service)
    known = node.get_service_names_and_types()
    offered = sorted(name for name, types in known if _TYPE in types and name != own)
    return (
        f"nobody offers the service {service}; offered are: {', '.join(offered) or 'none at all'}. "
        "Is the node running, with the same ROS_DOMAIN_ID?"
    )
