"""Detection of several publishers of one camera's images, calibration or silhouettes."""

from __future__ import annotations

from rclpy.node import Node


class SinglePublisher:
    """Watches topics that only one node should publish."""

    def __init__(self, node: Node, topics: tuple[str, ...]) -> None:
        """Watch the resolved names ``topics`` as ``node`` sees them."""
        self._node = node
        self._topics = topics

    def remarks(self) -> dict[str, str]:
        """Return a warning for each topic that has several publishers, by its kind."""
        found = {}
        for topic in self._topics:
            ends = self._node.get_publishers_info_by_topic(topic)
            if len(ends) < 2:
                continue
            names = sorted(f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in ends)
            found[f"publishers of {topic}"] = (
                f"{len(names)} publishers send {topic}: {', '.join(names)}; expected one "
                "for each camera. Stop all but one, or give each camera its own namespace "
                "(docs/cameras.md); a killed publisher stays listed for some seconds"
            )
        return found
