"""The latest messages, limited in number and in memory, whatever their size."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from sensor_msgs.msg import Image

MOST_BYTES = 64_000_000
"""Memory for the images of one kind: all that is asked for up to 1920x1080 in grey."""


class RecentImages:
    """The latest images, the oldest first; older ones make room for a new one."""

    def __init__(self, count: int, most_bytes: int = MOST_BYTES) -> None:
        """Keep at most ``count``, of ``most_bytes`` together; the latest is always kept."""
        self._count, self._most_bytes = count, most_bytes
        self._images: deque[Image] = deque()
        self._bytes = 0

    def append(self, image: Image) -> None:
        """Keep an image as the latest."""
        self._images.append(image)
        self._bytes += len(image.data)
        while len(self._images) > 1 and (
            len(self._images) > self._count or self._bytes > self._most_bytes
        ):
            self.popleft()

    def popleft(self) -> Image:
        """Forget the oldest and return it."""
        image = self._images.popleft()
        self._bytes -= len(image.data)
        return image

    def __len__(self) -> int:
        return len(self._images)

    def __iter__(self) -> Iterator[Image]:
        return iter(self._images)

    def __reversed__(self) -> Iterator[Image]:
        yield from reversed(self._images)
