"""Other nodes that use one of our topics with another message type, which nothing else reports.

Between such nodes nothing passes. DDS has an event for it that Fast DDS does not raise, so the
graph is asked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node


class TopicTypes:
    """Compares the types of a node's topics with those that others give them."""

    def __init__(self, node: Node) -> None:
        """Compare for ``node``; :meth:`add` says which topics."""
        self._node = node
        self._types: dict[str, str] = {}
        self._said: set[str] = set()

    def add(self, topic: str, kind: Any) -> None:
        """Compare the resolved name ``topic``, which this node uses for messages ``kind``."""
        self._types[topic] = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"

    def remarks(self) -> list[str]:
        """Return a text for each topic that has several types now; log what is new."""
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
            f"{end.topic_type}, this one as {own}: with a different message type, so nothing "
            "passes between the two; give one of them another topic"
            for verb, ends in asked
            for end in ends(topic)
            if end.topic_type != own
        ]
