"""A bus that replaces DDS in tests of a node, and messages for it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from cardbox_tracker.person.skeleton import JOINT_NAMES


class Bus:
    """Passes messages to the nodes' subscriptions, and records published messages.

    Attributes:
        sent: published messages by the topic's full name.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from cardbox_tracker.ros.runtime.node import CardboxNode

        self.sent: dict[str, list[Any]] = defaultdict(list)
        self._subscribers: dict[str, Callable[..., None]] = {}
        self._timers: list[Callable[[], None]] = []
        self._nodes: list[Any] = []

        def publisher(node: Any, _: Any, topic: str, *__: Any, **___: Any) -> Any:
            name = node.resolve_topic_name(topic)
            return SimpleNamespace(
                publish=self.sent[name].append, get_subscription_count=lambda: 1, topic_name=name
            )

        monkeypatch.setattr(CardboxNode, "create_publisher", publisher)
        monkeypatch.setattr(
            CardboxNode,
            "create_timer",
            lambda _, __, callback, **___: self._timers.append(callback),
        )

    def start(self, kind: Callable[..., Any], **parameters: Any) -> Any:
        """Start a node with ``parameters`` on this bus."""
        from rclpy.parameter import Parameter

        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = kind(intra_process=self, parameter_overrides=overrides, enable_rosout=False)
        self._nodes.append(node)
        return node

    def send(self, topic: str, message: Any, sent_ns: int = 0) -> None:
        """Pass a message to the node that subscribes to ``topic``."""
        self._subscribers[topic](message, {"source_timestamp": sent_ns})

    def tick(self) -> Any:
        """Run every timer once, and return the last published status of a node."""
        for callback in self._timers:
            callback()
        return self.sent["/diagnostics"][-1].status[0]

    def texts(self, topic: str) -> list[Any]:
        """Return the data of the messages on ``topic``."""
        return [message.data for message in self.sent[topic]]

    def advertise(self, publisher: Any) -> Any:
        """Replace the method of IntraProcess; the publisher already records messages."""
        return publisher

    def subscribe(self, topic: str, subscriber: Callable[..., None]) -> bool:
        """Replace the method of IntraProcess; every subscription belongs to this bus."""
        self._subscribers[topic] = subscriber
        return True

    def close(self) -> None:
        for node in self._nodes:
            node.close()
            node.destroy_node()


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    import rclpy

    rclpy.init(args=[])
    made = Bus(monkeypatch)
    yield made
    made.close()
    rclpy.shutdown()


@pytest.fixture
def joints() -> Callable[..., Any]:
    """Return a function that makes joint states with a stamp in tenths of a second."""
    from sensor_msgs.msg import JointState

    def make(tenth: int, values: dict[str, float], other: float = 0.0) -> Any:
        message = JointState(name=list(JOINT_NAMES))
        message.position = [values.get(name, other) for name in JOINT_NAMES]
        message.header.stamp.sec, message.header.stamp.nanosec = 1, tenth * 10**8
        return message

    return make


class Hands:
    """Replaces the intra-process topics of one process."""

    def __init__(self) -> None:
        self.takers: dict[str, Any] = {}

    def subscribe(self, topic: str, taker: Any) -> bool:
        self.takers[topic] = taker
        return True

    def give(self, topic: str, message: Any) -> None:
        self.takers[topic](message, {"source_timestamp": 0})


@pytest.fixture
def hands() -> Hands:
    return Hands()
