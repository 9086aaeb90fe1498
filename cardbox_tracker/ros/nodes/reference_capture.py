"""Capture of reference silhouettes from the latest silhouettes and images."""

from __future__ import annotations

import time

from sensor_msgs.msg import Image

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.asked_outline import check_asked
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.references import Silhouette, average_silhouette, check_reference
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.ros.messages.conversions import ImageArray, image_of, silhouette_of, stamp_ns
from cardbox_tracker.ros.runtime.recent import RecentImages

KEPT = 5
"""Silhouettes that a capture combines: more have less noise, but need longer standing still."""
ONE_POSTURE_NS = 1_000_000_000
"""Older silhouettes may show the posture before."""
_OLD_S = 2.0


def alike_of(recent: RecentImages) -> list[Image]:
    """Return the images with the posture and size of the last one, which is among them."""
    messages = list(recent)
    latest = messages[-1]
    now_ns = stamp_ns(latest.header.stamp)
    return [
        message
        for message in messages
        if (message.width, message.height) == (latest.width, latest.height)
        and 0 <= now_ns - stamp_ns(message.header.stamp) <= ONE_POSTURE_NS
    ]


class ReferenceCapture:
    """The references captured so far, by name.

    Attributes:
        captured: reference silhouettes (H, W), 0 or 255.
        images: images (H, W, 3) bgr or (H, W) of the silhouettes whose image came in time.
    """

    def __init__(self, topic: str) -> None:
        """Begin without references; error texts name the ``topic`` of the silhouettes."""
        self.captured: dict[str, Silhouette] = {}
        self.images: dict[str, list[ImageArray]] = {}
        self._topic = topic
        self._recent = RecentImages(KEPT)
        self._recent_images = RecentImages(KEPT)
        self._received_s = 0.0

    def add(self, message: Image) -> None:
        """Add the latest silhouette.

        Raises:
            EncodingError: the message is not a silhouette.
        """
        silhouette_of(message)
        self._recent.append(message)
        self._received_s = time.monotonic()

    def add_image(self, message: Image, _: int) -> None:
        """Add the image of the silhouette with the same stamp."""
        self._recent_images.append(message)

    def behind(self, message: Image) -> Image | None:
        """Return the image of a silhouette, or None if it has not arrived."""
        stamp = stamp_ns(message.header.stamp)
        images = reversed(self._recent_images)
        return next((image for image in images if stamp_ns(image.header.stamp) == stamp), None)

    @property
    def latest_ns(self) -> int | None:
        """Stamp of the latest silhouette; None before the first one."""
        latest = next(reversed(self._recent), None)
        return None if latest is None else stamp_ns(latest.header.stamp)

    @property
    def missing(self) -> list[str]:
        """Names of the references still to be captured."""
        return [name for name in REFERENCE_NAMES if name not in self.captured]

    @property
    def has_silhouettes(self) -> bool:
        """Whether a silhouette was received."""
        return bool(self._recent)

    def check_running(self) -> None:
        """Raise InitializationError if no silhouette was received yet."""
        if not self._recent:
            raise InitializationError(
                f"no silhouette was received yet on {self._topic}; start the background node, let "
                "it learn the empty scene, then step in front of the camera"
            )

    def capture(self, name: str, camera: Camera | None, config: InitializationConfig) -> str:
        """Keep the majority of the latest silhouettes as the reference ``name``.

        If the working camera is known, the posture is compared with the requested one.

        Returns:
            Text with the result and the missing references, for a person.

        Raises:
            InitializationError: there is no silhouette, or it shows nobody, a person who is cut
                off, or another posture.
        """
        self.check_running()
        alike = alike_of(self._recent)
        silhouettes = [silhouette_of(message) for message in alike]
        silhouette = average_silhouette(silhouettes)
        check_reference(name, silhouette)
        warning = ""
        if camera is not None and silhouette.shape == (camera.height, camera.width):
            warning = check_asked(name, silhouette, camera, config)
        stamps = {stamp_ns(message.header.stamp) for message in alike}
        images = [m for m in self._recent_images if stamp_ns(m.header.stamp) in stamps]
        self.captured[name] = silhouette
        # If stamps repeat, there can be more images than silhouettes.
        self.images[name] = [image_of(message) for message in images[-len(alike) :]]
        text = f"captured '{name}' from {len(silhouettes)} silhouettes{warning}"
        age_s = time.monotonic() - self._received_s
        if age_s > _OLD_S:
            text += (
                f"; the latest came {age_s:.0f} s ago, as it must while a recording is paused; of "
                "a camera, see whether it runs"
            )
        if self.missing:
            return f"{text}; missing: {', '.join(self.missing)}"
        return f"{text}; all three are there"
