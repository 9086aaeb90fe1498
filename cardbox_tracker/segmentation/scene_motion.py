"""Detects motion before a fixed camera, as small as the sway of a standing person.

A standing person sways by some millimetres, which moves every edge of the body. Means over a few
images have little noise, so two of them differ along the outline of a person but nowhere in an
empty scene. docs/evaluation/silhouettes.md has the measured shares of moving pixels.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.segmentation.chroma import DARKEST

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# Motion is detected at half the resolution, where averaging halves the noise.
SCALE, SMOOTHING_PX = 2, 0.8
"""How much smaller the images are, and the deviation of the Gaussian that smooths them, px."""
# Images per mean, whose noise is less than half of an image's.
_MEAN_OF = 5
# A changed pixel differs by at least this many grey levels and this multiple of the noise. The
# estimated noise is limited, since a running person smears over half of the image.
_LEAST, _MOST = 2.0, 8.0
_TIMES_NOISE = 6.0
# Standard deviation of a normal distribution from the median of its absolute values.
_FROM_MEDIAN = 1.4826


class SceneMotion:
    """Compares the latest images with the first ones.

    Attributes:
        moved: mask of pixels that have moved so far, (H / 2, W / 2) bool; None before the second
            mean.
    """

    def __init__(self, images: int) -> None:
        """Start without images; ``images`` is the number that will be added, 2 or more."""
        self._of = max(1, min(_MEAN_OF, images // 2))
        self._latest: deque[FloatImage] = deque(maxlen=self._of)
        self._count = 0
        self._first: FloatImage | None = None
        self.moved: Mask | None = None

    def add(self, brightness: ImageArray) -> float:
        """Add an image (H, W); return the share of the pixels that have moved so far."""
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
    size = (max(width // SCALE, 1), max(height // SCALE, 1))
    small = cv2.resize(brightness, size, interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), SMOOTHING_PX), np.float32)


def changed_pixels(
    before: FloatImage, after: FloatImage, times_noise: float = _TIMES_NOISE
) -> Mask:
    """Return a mask of pixels in which two images (h, w) differ by a multiple of their noise.

    The level of the light and the noise are medians, since moving pixels are less than half.
    """
    ratios = np.asarray(after / np.maximum(before, DARKEST), np.float32)
    level = max(float(np.median(ratios)), 1e-3)
    # Differences grow with the light.
    difference = np.asarray(np.abs(after - level * before) / max(level, 1.0), np.float32)
    noise = _FROM_MEDIAN * float(np.median(difference))
    return np.asarray(difference > min(max(_LEAST, times_noise * noise), _MOST), np.bool_)
