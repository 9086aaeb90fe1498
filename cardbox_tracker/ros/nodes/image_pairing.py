"""Pairing of silhouettes with their images by the stamp."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import Image

from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.runtime.recent import RecentImages

Deliver = Callable[[Image, Image | None, int], None]
"""Callback that receives a silhouette, its image or None, and the silhouette's send time, ns."""

_KEPT = 5
# After so many consecutive silhouettes without an image, the next ones do not wait.
_PATIENCE = 5


class ImagePairing:
    """Delivers every silhouette once and in order, with its image if that comes in time.

    The background node sends an image before its silhouette, so the image has usually arrived. If
    not, the silhouette waits for it, but not longer than until the next silhouette.

    Attributes:
        waits: False to deliver silhouettes at once, with or without image.
    """

    def __init__(self, deliver: Deliver) -> None:
        """Deliver to the callback ``deliver``."""
        self.waits = True
        self._deliver = deliver
        self._images = RecentImages(_KEPT)
        self._waiting: tuple[Image, int] | None = None
        # Silhouettes wait only after the first image, because there may be no publisher.
        self._patience = 0

    def add_image(self, image: Image, _: int) -> None:
        """Add an image, and deliver the silhouette that waits for it."""
        self._images.append(image)
        self._patience = _PATIENCE
        if self._waiting is not None and _stamp(self._waiting[0]) == _stamp(image):
            self._hand_on(image)

    def add_silhouette(self, silhouette: Image, sent_ns: int) -> None:
        """Add a silhouette, and deliver the previous one if it still waits."""
        try:
            if self._waiting is not None:
                self._patience -= 1
                self._hand_on(None)
        finally:
            self._waiting = silhouette, sent_ns
            image = self._image_of(_stamp(silhouette))
            if image is not None or not self.waits or self._patience <= 0:
                self._hand_on(image)

    def _image_of(self, stamp: int) -> Image | None:
        """Return the latest image of a stamp; after a repetition, earlier ones are used up."""
        return next((image for image in reversed(self._images) if _stamp(image) == stamp), None)

    def _hand_on(self, image: Image | None) -> None:
        if self._waiting is not None:
            silhouette, sent_ns = self._waiting
            self._waiting = None
            if image is not None:
                while len(self._images) and self._images.popleft() is not image:
                    pass
            self._deliver(silhouette, image, sent_ns)


def _stamp(message: Image) -> int:
    return stamp_ns(message.header.stamp)
