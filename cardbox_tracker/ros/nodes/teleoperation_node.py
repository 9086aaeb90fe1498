"""The node ``teleoperation`` streams the tracked person to programs that teleoperate robots."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from std_msgs.msg import ByteMultiArray, String

from cardbox_tracker.applications.teleoperation.full_body import FullBodies, FullBody
from cardbox_tracker.applications.teleoperation.sending import PACKETS, Packets, sender_of
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.outputs import joints_of
from cardbox_tracker.ros.nodes.posture_input import PostureInput, Tracked
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start
from cardbox_tracker.ros.runtime.parameters import LiveParameters

_TOPICS: dict[str, tuple[Any, str]] = {
    "isaac": (ByteMultiArray, "xr_teleop/full_body"),
    "json": (String, "teleoperation/full_body"),
}


@dataclass(frozen=True)
class TeleoperationParameters(NodeParameters):
    """Stream the tracked person as 24 joints to programs that teleoperate robots."""

    to: str = at_start("isaac", "who reads the stream", choices=tuple(PACKETS))
    address: str = at_start(
        "",
        "ZMQ address on which the stream is published, as tcp://127.0.0.1:5556, or for vmc where "
        "it is sent, udp://127.0.0.1:39539; empty: the topic of the reader",
    )
    rate_hz: float = at_start(50.0, "packets a second", unit="Hz", limits=(1.0, 1000.0))
    timeout_s: float = at_start(
        0.5, "no joint is valid after this time without a posture", unit="s", limits=(0.05, 10.0)
    )


class TeleoperationNode(CardboxNode):
    """Streams the full body at a constant rate, one image late: between it and the one before."""

    def __init__(self, **options: Any) -> None:
        super().__init__("teleoperation", **options)
        self._settings = LiveParameters(self, TeleoperationParameters).value
        to, address = self._settings.to, self._settings.address
        if to not in _TOPICS and not address:
            example = "udp://127.0.0.1:39539" if to == "vmc" else "tcp://127.0.0.1:5556"
            raise CardboxError(f"{to} has no topic: give the parameter address, {example}")
        self._sender = sender_of(to, address) if address else None
        for remark in self._sender.remarks if self._sender else ():
            self.get_logger().warning(remark)
        if not address:
            self._publisher = self.advertise(*_TOPICS[to], qos.RESULT)
        self._bodies = FullBodies()
        self._pair: tuple[FullBody, FullBody] | None = None
        self._arrived_s, self._packets = 0.0, Packets(to, self._settings.rate_hz)
        self._input = PostureInput(self, self._take)
        self.create_timer(1.0 / self._settings.rate_hz, self._stream)

    def _take(self, image: Tracked) -> None:
        values, stddev = (
            {} if one is None else joints_of(one).by_name for one in (image.joints, image.stddev)
        )
        body = self._bodies.update(
            *(image.stamp_ns, image.state, image.body, values, stddev, image.keypoints or {})
        )
        if body is not None:
            before = self._pair[1] if self._pair else body
            # After a gap nothing lies between.
            is_near = 0 < body.stamp_ns - before.stamp_ns < self._settings.timeout_s * 1e9
            self._pair = (before if is_near else body), body
            self._arrived_s = time.monotonic()

    def _stream(self) -> None:
        if self._pair is None:
            return
        before, after = self._pair
        passed_s = time.monotonic() - self._arrived_s
        now_ns = before.stamp_ns + round(passed_s * 1e9)
        body = before.until(after, now_ns)
        if passed_s > self._settings.timeout_s:
            body = after.invalid(now_ns)
        made = self._packets.of(body)
        if made is None:
            return
        if self._sender is not None:
            self._sender.send(made)
        elif self._settings.to == "json":
            self._publisher.publish(String(data=made.decode()))
        else:
            self._publisher.publish(ByteMultiArray(data=[bytes([one]) for one in made]))

    def close(self) -> None:
        """Free the address."""
        if self._sender is not None:
            self._sender.close()


main = node_main("teleoperation", TeleoperationNode, TeleoperationParameters)
