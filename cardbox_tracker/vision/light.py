"""Follows the light of the scene, so that a background learned once stays right.

Slow drift, an automatic gain or a lamp multiply the background by a factor that varies slowly over
the image: one level for all of it, times a coarse field. Both are estimated in every image from
pixels outside the person, so that nobody who stands still becomes background.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.chroma import bgr_of

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Light is estimated on an image smaller by this factor.
_SHRINK = 4
# Cells of the coarse field, and the standard deviation of its smoothing in cells.
_CELLS = (20, 15)
_SMOOTHING_CELLS = 2.0
# Pixels darker than this, or near the brightest value, say nothing about the light.
_DARKEST, _BRIGHTEST = 10.0, 250.0
# A field that differs from 1 by less is none.
_SAME = 0.004
# Brightness of blue, green and red.
_WEIGHTS = np.array([0.114, 0.587, 0.299], np.float32)
# The field comes nearer to its estimate by this fraction in each image: half of it in 7 images.
_RATE = 0.1
# A pixel whose brightness differs from the expected one by more is no background.
_TOLERANCE, _TOLERANCE_AFTER_STEP = 0.1, 0.4
# A change of the level from one image to the next by more is a step of the light: a lamp, a gain.
_STEP = 0.04
# So many images after a step the field is taken as estimated, and the person as known before it.
_SETTLING = 8
# Share of the pixels that must be known to be background.
_ENOUGH = 0.15
_KERNEL = np.ones((5, 5), np.uint8)
# More of the image than a person covers: the light has changed, not the scene.
_COVERAGE = 0.5


class LightFollower:
    """How bright each pixel of the background is now.

    Attributes:
        level: brightness of the scene as a factor of what was learned.
    """

    def __init__(self, mean: FloatImage, chroma: FloatImage | None = None) -> None:
        """Start with the light that the background was learned in.

        Args:
            mean: brightness of the background, (H, W).
            chroma: brightness, Cr and Cb of it at any resolution, (3, h, w); None: it is grey.
        """
        height, width = mean.shape
        self._size = (max(width // _SHRINK, 1), max(height // _SHRINK, 1))
        small = cv2.resize(mean, self._size, interpolation=cv2.INTER_AREA)
        self._small = np.asarray(small, np.float32).reshape(self._size[::-1])
        self._usable = self._small > _DARKEST
        self._mean = mean
        self._now = np.empty_like(mean)
        channels = mean[None]
        if chroma is not None:
            planes = [cv2.resize(one, mean.shape[::-1]) for one in chroma[1:]]
            channels = bgr_of(np.stack([mean, *planes]))
        self._channels = channels.reshape(len(channels), -1)
        self._brightest = self._channels.max(axis=0)
        brightest = cv2.resize(
            self._brightest.reshape(mean.shape), self._size, interpolation=cv2.INTER_AREA
        )
        self._small_brightest = brightest.reshape(self._size[::-1])
        self.restart()

    def restart(self) -> None:
        """Forget the light and the person; the next image may be of any other moment."""
        self.level = 1.0
        self._field = np.ones(_CELLS[::-1], np.float32)
        self._fine = np.ones(self._size[::-1], np.float32)
        self._person = np.zeros(self._size[::-1], bool)
        self._settling = 0
        self._started = False

    def follow(self, brightness: ImageArray) -> FloatImage:
        """Return the background (H, W) as it is in the light of an image (H, W).

        The array is the same in each call.
        """
        self._estimate(brightness)
        if np.all(np.abs(self._field - 1.0) < _SAME):
            np.multiply(self._mean, np.float32(self.level), out=self._now)
        else:
            field = cv2.resize(self._field, self._mean.shape[::-1])
            cv2.multiply(self._mean, field, dst=self._now, scale=self.level)
        self._cut_off()
        return self._now

    def _cut_off(self) -> None:
        """Let no channel of what is expected be brighter than a camera can tell."""
        factor = self.level * float(self._field.max())
        if factor * float(self._brightest.max()) < _BRIGHTEST:
            return
        where = np.flatnonzero(self._brightest > _BRIGHTEST / factor)
        now = self._now.ravel()
        factors = now[where] / np.maximum(self._mean.ravel()[where], 1.0)
        channels = np.minimum(self._channels[:, where] * factors, 255.0)
        now[where] = _WEIGHTS @ channels if len(channels) == 3 else channels[0]

    def _estimate(self, brightness: ImageArray) -> None:
        small = cv2.resize(brightness, self._size, interpolation=cv2.INTER_AREA)
        small = small.reshape(self._size[::-1]).astype(np.float32)
        ratio = small / np.maximum(self._small, np.float32(1))
        known = self._usable & (ratio * self._small_brightest < _BRIGHTEST)
        if not known.any():
            return
        outside = known & ~self._person
        if np.count_nonzero(outside) < _ENOUGH * outside.size:
            outside = known
        level = float(np.median((ratio / self._fine)[outside]))
        if self._started and abs(level / max(self.level, 1e-3) - 1.0) > _STEP:
            self._settling = _SETTLING
        self._started = True
        self.level = max(level, 1e-3)
        self._adapt(np.asarray(ratio / self.level, np.float32), outside)

    def exclude(self, silhouette: ImageArray) -> None:
        """Take the person's place (H, W) from the silhouette found in the last image."""
        if np.count_nonzero(silhouette) > _COVERAGE * silhouette.size:
            self._settling = _SETTLING
        if self._settling > 0:
            self._settling -= 1
            return
        small = cv2.resize(silhouette, self._size, interpolation=cv2.INTER_AREA)
        person = (small.reshape(self._size[::-1]) > 0).astype(np.uint8)
        self._person = cv2.dilate(person, _KERNEL).reshape(self._size[::-1]) > 0

    def _adapt(self, relative: FloatImage, outside: NDArray[np.bool_]) -> None:
        if self._settling > 0:
            # The person may have moved since.
            wider = cv2.dilate(self._person.astype(np.uint8), _KERNEL).reshape(outside.shape)
            near, rate, tolerance = wider > 0, 1.0, _TOLERANCE_AFTER_STEP
            usable = outside & ~near & (np.abs(relative - 1.0) < tolerance)
        else:
            rate, tolerance = _RATE, _TOLERANCE
            usable = outside & (np.abs(relative / self._fine - 1.0) < tolerance)
        weights = usable.astype(np.float32)
        change = (relative - 1.0) * weights
        cells = [_coarse(one) for one in (change, weights)]
        # Where nothing is known, there is no change.
        estimate = 1.0 + cells[0] / (cells[1] + 0.02)
        self._field += np.float32(rate) * (estimate - self._field)
        self._fine = cv2.resize(self._field, self._size).reshape(outside.shape)


def _coarse(values: FloatImage) -> FloatImage:
    cells = cv2.resize(values, _CELLS, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(cells, (0, 0), _SMOOTHING_CELLS), np.float32)
