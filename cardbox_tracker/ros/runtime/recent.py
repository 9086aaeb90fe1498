"""The latest images, limited in number and memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from sensor_msgs.msg import Image

MOST_BYTES = 64_000_000
"""Memory for the images of one topic; it suffices for grey images of up to 1920x1080."""


class RecentImages:
    """Queue of the latest images, the oldest first, which drops old images for new ones."""

    def __init__(self, count: int, most_bytes: int = MOST_BYTES) -> None:
        """Keep at most ``count`` images of ``most_bytes`` in total, and always the latest."""
        self._count, self._most_bytes = count, most_bytes
        self._images: deque[Image] = deque()
        self._bytes = 0

    def append(self, image: Image) -> None:
        """Add the latest image."""
        self._images.append(image)
        self._bytes += len(image.data)
        while len(self._images) > 1 and (
            len(self._images) > self._count or self._bytes > self._most_bytes
        ):
            self.popleft()

    def popleft(self) -> Image:
        """Remove the oldest image and return it."""
        image = self._images.popleft()
        self._bytes -= len(image.data)
        return image

    def __len__(self) -> int:
        return len(self._images)

    def __iter__(self) -> Iterator[Image]:
        return iter(self._images)

    def __reversed__(self) -> Iterator[Image]:
        yield from reversed(self._images)
