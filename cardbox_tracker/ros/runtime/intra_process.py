"""Messages passed between the nodes of one process without DDS.

DDS serializes and copies each message and wakes another thread. Inside one process, the tracker
gets the silhouette directly. Nodes of other processes then get the message over DDS.
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
        """Begin without topics."""
        self._subscribers: dict[str, list[Subscriber]] = {}

    def advertise(self, publisher: Publisher) -> IntraProcessPublisher:
        """Pass the messages of ``publisher`` to subscribers of this process from now on."""
        return IntraProcessPublisher(
            publisher, self._subscribers.setdefault(publisher.topic_name, [])
        )

    def subscribe(self, topic: str, subscriber: Subscriber) -> bool:
        """Call ``subscriber`` with each message; return False if nobody here offers ``topic``."""
        subscribers = self._subscribers.get(topic)
        if subscribers is None:
            return False
        subscribers.append(subscriber)
        return True


class IntraProcessPublisher:
    """Publishes to the subscribers of this process in order, then to all others."""

    def __init__(self, publisher: Publisher, subscribers: list[Subscriber]) -> None:
        """Publish to other processes with ``publisher``."""
        self._publisher = publisher
        self._subscribers = subscribers

    def get_subscription_count(self) -> int:
        """Return the number of subscribers in this process and in others."""
        return len(self._subscribers) + int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Call all subscribers of this process, which must not change ``message``."""
        for subscriber in self._subscribers:
            subscriber(message, {"source_timestamp": time.time_ns()})
        if self._publisher.get_subscription_count():
            self._publisher.publish(message)
