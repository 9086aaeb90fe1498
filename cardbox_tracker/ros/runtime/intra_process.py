"""Messages passed between the nodes of one process without DDS.

Over DDS a silhouette is serialized, copied, announced to another thread and deserialized; passed on
inside the process, the tracker has it at once. Nodes of other processes get the message over DDS,
after those of this one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher

Subscriber = Callable[[Any, dict[str, Any]], None]
"""A callback that takes a message and rclpy's information about it."""


class IntraProcess:
    """The subscribers of this process by topic; one object for all its nodes."""

    def __init__(self) -> None:
        """Start with no topic."""
        self._subscribers: dict[str, list[Subscriber]] = {}

    def advertise(self, publisher: Publisher) -> IntraProcessPublisher:
        """Hand over what is published with ``publisher`` from now on."""
        return IntraProcessPublisher(
            publisher, self._subscribers.setdefault(publisher.topic_name, [])
        )

    def subscribe(self, topic: str, subscriber: Subscriber) -> bool:
        """Call ``subscriber`` with each message; False if no node here advertises ``topic``."""
        subscribers = self._subscribers.get(topic)
        if subscribers is None:
            return False
        subscribers.append(subscriber)
        return True


class IntraProcessPublisher:
    """Publishes to the subscribers of this process in their order, then to all others."""

    def __init__(self, publisher: Publisher, subscribers: list[Subscriber]) -> None:
        """Publish with ``publisher`` where a node of another process subscribes."""
        self._publisher = publisher
        self._subscribers = subscribers

    def get_subscription_count(self) -> int:
        """Return the number of subscribers in this process and in others."""
        return len(self._subscribers) + int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Return when the subscribers of this process are done; they must not change it."""
        for subscriber in self._subscribers:
            subscriber(message, {"source_timestamp": time.time_ns()})
        if self._publisher.get_subscription_count():
            self._publisher.publish(message)
