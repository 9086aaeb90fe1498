"""Statistics and faults of one stream of messages that a node receives, and its latest images."""

from __future__ import annotations

import time
from collections import deque

from sensor_msgs.msg import Image

from cardbox_tracker.camera.stamps import StampOrder, StreamStatistics
from cardbox_tracker.ros.messages.conversions import stamp_ns


class InputStream:
    """Statistics and faults of the messages of one topic.

    Attributes:
        name: name in the diagnostics.
        topic: full name of the topic.
        statistics: order, rate and losses by the stamps.
        problem: why the last message could not be used; empty if it could.
        newest_ns: stamp of the last message.
        transit_s: arrival of the last message minus its send time, by the clocks of both ends.
    """

    def __init__(self, name: str, topic: str) -> None:
        self.name, self.topic = name, topic
        self.statistics = StreamStatistics()
        self.problem = ""
        self.newest_ns = 0
        self.transit_s = 0.0
        self._arrived_s = self._counted_s = time.monotonic()
        self._counted = 0

    @property
    def age_s(self) -> float:
        """Seconds since the last message, or since the start."""
        return time.monotonic() - self._arrived_s

    @property
    def delay_s(self) -> float:
        """Arrival of the last message minus its stamp, seconds, with an unknown constant."""
        return self._arrived_s - self.newest_ns / 1e9

    def arrived(self, stamp_ns: int, sent_ns: int = 0) -> StampOrder:
        """Count a message, and return the relation of its stamp to the one before."""
        self.transit_s = (time.time_ns() - sent_ns) / 1e9
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


MOST_BYTES = 64_000_000
"""Memory for the images of one topic; it suffices for grey images of up to 1920x1080."""


class RecentImages(deque[Image]):
    """Queue of the latest images, the oldest first, which drops old images for new ones."""

    def __init__(self, count: int, most_bytes: int = MOST_BYTES) -> None:
        """Keep at most ``count`` images of ``most_bytes`` in total, and always the latest."""
        super().__init__(maxlen=count)
        self._most_bytes = most_bytes

    def append(self, image: Image) -> None:
        """Add the latest image."""
        super().append(image)
        while len(self) > 1 and sum(len(one.data) for one in self) > self._most_bytes:
            self.popleft()

    def at(self, at_ns: int) -> Image | None:
        """Return the latest image with a stamp, ns; None if there is none."""
        return next((one for one in reversed(self) if stamp_ns(one.header.stamp) == at_ns), None)
