"""Subscribes to a topic whose message may have been sent, and latched, before the node started."""

from __future__ import annotations

from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile

from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import Callback, CardboxNode

_LATCHES = DurabilityPolicy.TRANSIENT_LOCAL
_LOOK_S = 1.0


class LatchedInput:
    """A subscription that also asks for the last message of publishers that latch it.

    It asks only if there is such a publisher, since others would report a mismatch of QoS.
    """

    def __init__(
        self, node: CardboxNode, kind: Any, topic: str, callback: Callback, profile: QoSProfile
    ) -> None:
        """Subscribe with ``node``, see :meth:`.CardboxNode.subscribe`."""
        self._node, self._kind, self._topic, self._callback = node, kind, topic, callback
        self._has_come = self._asks = False
        node.subscribe(kind, topic, self._heard, profile)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(_LOOK_S, self.look, clock=steady)

    def _heard(self, message: Any, sent_ns: int) -> None:
        self._has_come = True
        self._callback(message, sent_ns)

    def look(self) -> None:
        """Ask for the last message if none has come and a publisher latches it."""
        if self._has_come or self._asks:
            return
        ends = self._node.get_publishers_info_by_topic(self._node.resolve(self._topic))
        self._asks = any(end.qos_profile.durability == _LATCHES for end in ends)
        if self._asks:
            self._node.subscribe(
                self._kind, self._topic, self._heard, qos.LATCHED, is_overridable=False
            )
