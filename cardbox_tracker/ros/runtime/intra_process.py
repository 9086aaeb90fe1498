"""Messages passed between the nodes of one process without DDS.

Over DDS a silhouette is serialized, copied, announced to another thread and deserialized; passed on
inside the process, the tracker has it at once. Measured at 30 Hz, the joint states come a quarter
earlier in the median. Nodes of other processes get the message over DDS, after those of this one.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.publisher import Publisher

Taker = Callable[[Any, dict[str, Any]], None]
"""What rclpy calls with a message and its circumstances."""


class IntraProcess:
    """Which callbacks of this process take a topic's messages; one for all its nodes."""

    def __init__(self) -> None:
        """Start with no topic."""
        self._takers: dict[str, list[Taker]] = {}

    def offer(self, publisher: Publisher) -> IntraProcessPublisher:
        """Hand over what is published with ``publisher`` from now on."""
        return IntraProcessPublisher(publisher, self._takers.setdefault(publisher.topic_name, []))

    def take(self, topic: str, taker: Taker) -> bool:
        """Call ``taker`` with each message on ``topic``; False if nobody here offers it."""
        takers = self._takers.get(topic)
        if takers is None:
            return False
        takers.append(taker)
        return True


class IntraProcessPublisher:
    """Publishes to the takers of this process in their order, then to all others."""

    def __init__(self, publisher: Publisher, takers: list[Taker]) -> None:
        """Publish with ``publisher`` where a node of another process subscribes."""
        self._publisher = publisher
        self._takers = takers

    def get_subscription_count(self) -> int:
        """Return how many take the messages, in this process and in others."""
        return len(self._takers) + int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Return when the takers are done; they share ``message`` and leave it as it is."""
        for taker in self._takers:
            taker(message, {"source_timestamp": time.time_ns()})
        if self._publisher.get_subscription_count():
            self._publisher.publish(message)
