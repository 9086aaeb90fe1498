"""Statistics and faults of one stream of messages that a node receives."""

from __future__ import annotations

import time

from cardbox_tracker.vision.stamps import StampOrder, StreamStatistics


class InputStream:
    """Statistics and faults of the messages of one topic.

    Attributes:
        name: name in the diagnostics.
        topic: full name of the topic.
        statistics: order, rate and losses by the stamps.
        problem: why the last message could not be used; empty if it could.
        newest_ns: stamp of the last message.
    """

    def __init__(self, name: str, topic: str) -> None:
        """Begin without messages."""
        self.name, self.topic = name, topic
        self.statistics = StreamStatistics()
        self.problem = ""
        self.newest_ns = 0
        self._arrived_s = self._counted_s = time.monotonic()
        self._counted = 0

    @property
    def age_s(self) -> float:
        """Seconds since the last message, or since the start."""
        return time.monotonic() - self._arrived_s

    def arrived(self, stamp_ns: int) -> StampOrder:
        """Count a message, and return the relation of its stamp to the one before."""
        self._arrived_s, self.newest_ns = time.monotonic(), stamp_ns
        return self.statistics.add(stamp_ns)

    def values(self) -> dict[str, str]:
        """Return the rate since the last call, and the age of the last message."""
        now_s, count = time.monotonic(), self.statistics.received
        rate = (count - self._counted) / max(now_s - self._counted_s, 1e-3)
        self._counted_s, self._counted = now_s, count
        return {
            f"{self.name} rate (Hz)": f"{rate:.1f}",
            f"{self.name} age (s)": f"{self.age_s:.1f}" if count else "never",
        }
