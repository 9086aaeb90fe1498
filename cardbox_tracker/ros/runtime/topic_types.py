"""Detection of other nodes that use a topic with another message type.

Such nodes exchange nothing. Fast DDS does not raise the DDS event for it, so the ROS graph is
queried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node


class TopicTypes:
    """Compares the message types of a node's topics with those of other nodes."""

    def __init__(self, node: Node) -> None:
        """Begin without topics of ``node``; :meth:`add` adds one."""
        self._node = node
        self._types: dict[str, str] = {}
        self._said: set[str] = set()

    def add(self, topic: str, kind: Any) -> None:
        """Compare the resolved name ``topic``, on which this node uses messages ``kind``."""
        self._types[topic] = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"

    def remarks(self) -> list[str]:
        """Return a warning for each topic with several types, and log new ones."""
        found = []
        for topic, types in self._node.get_topic_names_and_types():
            own = self._types.get(topic)
            if own is not None and len(types) > 1:
                found += self._others(topic, own)
        for text in found:
            if text not in self._said:
                self._said.add(text)
                self._node.get_logger().warning(text)
        return found

    def _others(self, topic: str, own: str) -> list[str]:
        node = self._node
        asked: Sequence[tuple[str, Callable[[str], Any]]] = (
            ("publishes", node.get_publishers_info_by_topic),
            ("subscribes to", node.get_subscriptions_info_by_topic),
        )
        return [
            f"another node ({end.node_namespace.rstrip('/')}/{end.node_name}) {verb} {topic} as "
            f"{end.topic_type}, this one as {own}; with a different message type, nothing passes "
            "between the two: give one of them another topic"
            for verb, ends in asked
            for end in ends(topic)
            if end.topic_type != own
        ]
