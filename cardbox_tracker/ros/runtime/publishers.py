"""Detection of no or several publishers of a topic, and of nodes that use it with another type."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node

from cardbox_tracker.common.health import WATCHES

_MOST_NAMED = 5
# Images that are made of a camera's.
_MADE = (
    *("/overlay", "/silhouette", "/silhouette/image", "/silhouette/camera_info"),
    *("/background/mean", "/background/stddev"),
)


class SinglePublisher:
    """Watches topics that exactly one node should publish."""

    def __init__(self, node: Node, topics: tuple[str, ...]) -> None:
        self._node = node
        # Numbers of checks without a publisher, of topics that never had one.
        self._absent = dict.fromkeys(topics, 0)
        self._topics = topics

    def remarks(self) -> dict[str, str]:
        """Return a warning for each topic with no or several publishers, by its kind."""
        found = {}
        for topic in self._topics:
            names = self._publishers(topic)
            if names:
                self._absent.pop(topic, None)
            several = WATCHES["publishers"]
            found[f"publishers of {topic}"] = several.remark(
                len(names), topic=topic, names=", ".join(names)
            )
            if topic in self._absent:
                self._absent[topic] += 1
                others = self._others(topic)
                if WATCHES["no publisher" if others else "no camera"].is_beyond(
                    self._absent[topic]
                ):
                    there = ", ".join(others[:_MOST_NAMED]) or "none at all"
                    words = WATCHES["no publisher"].words
                    found[f"no publisher of {topic}"] = words.format(topic=topic, there=there)
        return {kind: text for kind, text in found.items() if text}

    def _others(self, topic: str) -> list[str]:
        types = dict(self._node.get_topic_names_and_types())
        own = f"{self._node.get_namespace().rstrip('/')}/{self._node.get_name()}"
        return [
            name
            for name, kinds in types.items()
            if not name.endswith(_MADE)
            and set(kinds) & set(types.get(topic, ()))
            and {*self._publishers(name)} - {own}
        ]

    def _publishers(self, topic: str) -> list[str]:
        ends = self._node.get_publishers_info_by_topic(topic)
        return sorted(f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in ends)


class TopicTypes:
    """Compares the message types of a node's topics with those of other nodes."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._types: dict[str, str] = {}

    def add(self, topic: str, kind: Any) -> None:
        """Compare the resolved name ``topic``, on which this node uses messages ``kind``."""
        self._types[topic] = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"

    def remarks(self) -> dict[str, str]:
        """Return a warning for each other type of a topic, by itself."""
        return {
            text: text
            for topic, types in self._node.get_topic_names_and_types()
            if topic in self._types and len(types) > 1
            for text in self._others(topic, self._types[topic])
        }

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
