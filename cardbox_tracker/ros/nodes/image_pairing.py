"""Put each silhouette together with the image that it was cut out of, by their stamp."""

from __future__ import annotations

from collections.abc import Callable

from sensor_msgs.msg import Image

from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.runtime.recent import RecentImages

Deliver = Callable[[Image, Image | None, int], None]
"""Takes a silhouette, its image if there is one, and when the silhouette left its sender, ns."""

_KEPT = 5
# After so many silhouettes in a row without an image none is expected any more.
_PATIENCE = 5


class ImagePairing:
    """Hands on every silhouette once and in order, with its image where that comes in time.

    The background node sends an image before its silhouette, so it is mostly there. If not, the
    silhouette waits for it, at most until the next silhouette.

    Attributes:
        waits: False to hand on silhouettes at once, with what is there.
    """

    def __init__(self, deliver: Deliver) -> None:
        """Hand on to ``deliver``."""
        self.waits = True
        self._deliver = deliver
        self._images = RecentImages(_KEPT)
        self._waiting: tuple[Image, int] | None = None
        # None is expected before the first one: perhaps nobody sends any.
        self._patience = 0

    def add_image(self, image: Image, _: int) -> None:
        """Take an image, and hand on the silhouette that waits for it."""
        self._images.append(image)
        self._patience = _PATIENCE
        if self._waiting is not None and _stamp(self._waiting[0]) == _stamp(image):
            self._hand_on(image)

    def add_silhouette(self, silhouette: Image, sent_ns: int) -> None:
        """Take a silhouette; the one before has waited long enough."""
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
        """Return the latest image of that stamp: where stamps repeat, those before are used."""
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
