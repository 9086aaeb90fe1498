"""Whether something moves before a fixed camera, be it as little as a person who stands still.

Nobody stands still: a sway of some millimetres moves every edge of the body. Means over a few
images have little noise, so two of them differ along the outline of a person, and nowhere in an
empty scene. Of eleven recorded sessions, means within 30 images differed in 1.2 % of the image or
more wherever somebody was in it, and in 0.5 % or less of an empty scene
(docs/evaluation/silhouettes.md).
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]
Mask = NDArray[np.bool_]

STILL = 0.006
"""A scene is still if no larger share of its pixels moves."""

# Motion is looked for at a quarter of the pixels, the noise of which is halved.
_SCALE = 2
_SMOOTHING_PX = 0.8
# Images a mean is made of; their noise is less than half of an image's.
_MEAN_OF = 5
# A pixel has changed by so many grey levels at least, and so many times the noise; whoever runs
# past smears over half of the image, so what passes for noise has an end.
_LEAST, _MOST = 2.0, 8.0
_TIMES_NOISE = 6.0
_DARKEST = 8.0
# Standard deviation of a normal distribution from the median of its absolute values.
_FROM_MEDIAN = 1.4826


class SceneMotion:
    """Compares the latest images with the first ones, one image at a time.

    Attributes:
        moved: pixels that have moved so far, (H / 2, W / 2) bool; None before the second mean.
    """

    def __init__(self, images: int) -> None:
        """Start with nothing seen; ``images`` is how many will be shown, 2 or more."""
        self._of = max(1, min(_MEAN_OF, images // 2))
        self._latest: deque[FloatImage] = deque(maxlen=self._of)
        self._count = 0
        self._first: FloatImage | None = None
        self.moved: Mask | None = None

    def add(self, brightness: ImageArray) -> float:
        """Look at an image (H, W); return the share of the pixels that have moved so far."""
        self._latest.append(_small(brightness))
        self._count += 1
        if self._count == self._of:
            self._first = self._mean()
        elif self._first is not None and self._count >= 2 * self._of:
            changed = changed_pixels(self._first, self._mean())
            self.moved = changed if self.moved is None else self.moved | changed
        return 0.0 if self.moved is None else float(np.mean(self.moved))

    def _mean(self) -> FloatImage:
        return np.asarray(sum(self._latest) / np.float32(len(self._latest)), np.float32)


def _small(brightness: ImageArray) -> FloatImage:
    height, width = brightness.shape
    size = (max(width // _SCALE, 1), max(height // _SCALE, 1))
    small = cv2.resize(brightness, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), _SMOOTHING_PX), np.float32)


def changed_pixels(
    before: FloatImage, after: FloatImage, times_noise: float = _TIMES_NOISE
) -> Mask:
    """Return where two images (h, w) differ by so many times their noise, in whatever light.

    The level of the light and the noise are medians: what moves covers less than half of it.
    """
    level = max(float(np.median(after / np.maximum(before, _DARKEST))), 1e-3)
    # In more light differences are larger, too.
    difference = np.abs(after - level * before) / max(level, 1.0)
    noise = _FROM_MEDIAN * float(np.median(difference))
    return np.asarray(difference > min(max(_LEAST, times_noise * noise), _MOST), np.bool_)
