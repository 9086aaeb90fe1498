"""Two publishers of one camera's images or calibration are a mistake; here they are found."""

from __future__ import annotations

from rclpy.node import Node


class SinglePublisher:
    """Watches topics that one node should publish, and says in words when several do."""

    def __init__(self, node: Node, topics: tuple[str, ...]) -> None:
        """Watch the resolved names ``topics`` as ``node`` sees them."""
        self._node = node
        self._topics = topics

    def remarks(self) -> dict[str, str]:
        """Return a text for each topic that has several publishers now, by its kind."""
        found = {}
        for topic in self._topics:
            ends = self._node.get_publishers_info_by_topic(topic)
            if len(ends) < 2:
                continue
            names = sorted(f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in ends)
            found[f"publishers of {topic}"] = (
                f"{len(names)} publishers send {topic}: {', '.join(names)}; expected one camera. "
                "Stop all but one, or give each camera a namespace of its own (docs/cameras.md); "
                "one that was killed is listed for some seconds more"
            )
        return found
