"""Follows the light of the scene, so that a background learned once stays right.

Slow drift, an automatic gain or a lamp multiply the background by a factor that varies slowly over
the image: one level for all of it, times a coarse field. Both are estimated from pixels outside the
person, so that nobody who stands still becomes background.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.vision.chroma import bgr_of

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Light is estimated from every fourth pixel of every fourth row.
_GRID = (slice(1, None, 4), slice(1, None, 4))
# Cells of the coarse field, and the standard deviation of its smoothing in cells.
_CELLS = (20, 15)
_SMOOTHING_CELLS = 2.0
# Pixels darker than this, or near the brightest value, say nothing about the light.
_DARKEST, _BRIGHTEST = 10.0, 250.0
# A field that differs from 1 by less is none.
_SAME = 0.004
# Brightness of blue, green and red.
_WEIGHTS = np.array([0.114, 0.587, 0.299], np.float32)
# The level is estimated in every image, the field in every third, and in each after a step.
_EVERY = 3
# The field comes nearer to its estimate by this fraction each time: half of it in 7 images.
_RATE = 1.0 - 0.9**_EVERY
# A pixel whose brightness differs from the expected one by more is no background.
_TOLERANCE, _TOLERANCE_AFTER_STEP = 0.1, 0.4
# A change of the level from one image to the next by more is a step of the light: a lamp, a gain.
_STEP = 0.04
# So many images after a step the field is taken as estimated, and the person as known before it.
_SETTLING = 8
# Share of the pixels that must be known to be background.
_ENOUGH = 0.15
# Weight of no change, as a share of a cell's pixels.
_DOUBT = 0.02
_LEAST = 1e-3
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
        self._small = np.ascontiguousarray(mean[_GRID], np.float32)
        self._size = self._small.shape[1], self._small.shape[0]
        self._mean = mean
        self._now, self._scaled = np.empty_like(mean), np.empty_like(mean)
        channels = mean[None]
        if chroma is not None:
            planes = [cv2.resize(one, mean.shape[::-1]) for one in chroma[1:]]
            channels = bgr_of(np.stack([mean, *planes]))
        self._channels = channels.reshape(len(channels), -1)
        self._brightest = self._channels.max(axis=0)
        brightest = self._brightest.reshape(mean.shape)[_GRID]
        # Ratios of dark pixels are noise: they are never taken as background.
        self._small_brightest = np.where(self._small > _DARKEST, brightest, np.inf).astype(
            np.float32
        )
        self._highest = float(self._brightest.max())
        self._ratios = np.empty(self._size[0] * self._size[1], np.float32)
        self._cells = np.zeros((2, *_CELLS[::-1]), np.float32)
        self.restart()

    def restart(self) -> None:
        """Forget the light and the person; the next image may be of any other moment."""
        self.level = 1.0
        self._field = np.ones(_CELLS[::-1], np.float32)
        self._fine = np.ones(self._size[::-1], np.float32)
        self._person = np.zeros(self._size[::-1], np.uint8)
        self._settling = 0
        self._started = False
        self._images = 0
        self._relative, self._highest_field = self._mean, 1.0

    def expect_step(self) -> None:
        """Take the field of the next image as estimated, as after a step of the light."""
        self._settling = max(self._settling, 1)

    def follow(self, brightness: ImageArray) -> tuple[FloatImage, float]:
        """Return the background (H, W) and a factor: their product is as bright as it is now.

        Args:
            brightness: of an image, (H, W).

        Returns:
            An array that the next call may change, and a number.
        """
        self._estimate(brightness)
        if self.level * self._highest_field * self._highest < _BRIGHTEST:
            return self._relative, self.level
        np.multiply(self._relative, np.float32(self.level), out=self._now)
        self._cut_off()
        return self._now, 1.0

    @property
    def is_settling(self) -> bool:
        """True in the images after a step of the light, in which little is known of it."""
        return self._settling > 0

    def _cut_off(self) -> None:
        """Let no channel of what is expected be brighter than a camera can tell."""
        factor = self.level * self._highest_field
        where = np.flatnonzero(self._brightest > _BRIGHTEST / factor)
        now = self._now.ravel()
        factors = now[where] / np.maximum(self._mean.ravel()[where], 1.0)
        channels = np.minimum(self._channels[:, where] * factors, 255.0)
        now[where] = _WEIGHTS @ channels if len(channels) == 3 else channels[0]

    def _estimate(self, brightness: ImageArray) -> None:
        small = np.ascontiguousarray(brightness[_GRID])
        parts = small, self._small, self._small_brightest
        ratios = self._ratios
        count = collect_ratios(*parts, self._fine, self._person, ratios)
        if count < _ENOUGH * ratios.size:
            count = collect_ratios(*parts, self._fine, np.zeros_like(self._person), ratios)
        if count == 0:
            return
        level = max(float(np.partition(ratios[:count], count // 2)[count // 2]), _LEAST)
        if self._started and abs(level / self.level - 1.0) > _STEP:
            self._settling = _SETTLING
        self._started = True
        self.level = level
        number, self._images = self._images, self._images + 1
        if number % _EVERY and self._settling == 0:
            return
        person, rate, tolerance, around = self._person, _RATE, _TOLERANCE, self._fine
        if self._settling > 0:
            # The person may have moved since.
            person = cv2.dilate(self._person, _KERNEL).reshape(person.shape)
            rate, tolerance, around = 1.0, _TOLERANCE_AFTER_STEP, np.ones_like(self._fine)
        sum_cells(*parts, around, person, level, tolerance, self._cells)
        change, weight = (cv2.GaussianBlur(c, (0, 0), _SMOOTHING_CELLS) for c in self._cells)
        # Where nothing is known, there is no change.
        self._field += np.float32(rate) * (1.0 + change / (weight + _DOUBT) - self._field)
        self._fine = cv2.resize(self._field, self._size).reshape(small.shape)
        self._highest_field = float(self._field.max())
        if self._highest_field < 1.0 + _SAME and float(self._field.min()) > 1.0 - _SAME:
            self._relative = self._mean
        else:
            field = cv2.resize(self._field, self._mean.shape[::-1])
            cv2.multiply(self._mean, field, dst=self._scaled)
            self._relative = self._scaled

    def exclude(self, silhouette: ImageArray) -> None:
        """Take the person's place (H, W) from the silhouette found in the last image."""
        if cv2.countNonZero(silhouette) > _COVERAGE * silhouette.size:
            self._settling = _SETTLING
        if self._settling > 0:
            self._settling -= 1
            return
        person = np.ascontiguousarray(silhouette[_GRID])
        self._person = cv2.dilate(person, _KERNEL).reshape(person.shape)


@njit(cache=True, nogil=True, error_model="numpy")
def collect_ratios(
    small: Any, mean: Any, brightest: Any, field: Any, person: Any, ratios: Any
) -> Any:
    """Write how bright the background's pixels are as a factor of expected; return how many.

    Args:
        small: brightness of an image, (h, w) uint8.
        mean: brightness of the background.
        brightest: its brightest channel; infinite where it is not to be used.
        field: what is expected of each pixel as a factor of the level.
        person: not 0 where the person is.
        ratios: result, h * w numbers at least.
    """
    count = 0
    height, width = small.shape
    for v in range(height):
        for u in range(width):
            ratio = np.float32(small[v, u]) / max(mean[v, u], np.float32(1))
            if person[v, u] == 0 and ratio * brightest[v, u] < _BRIGHTEST:
                ratios[count] = ratio / field[v, u]
                count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def sum_cells(
    small: Any,
    mean: Any,
    brightest: Any,
    around: Any,
    person: Any,
    level: Any,
    tolerance: Any,
    cells: Any,
) -> None:
    """Write the mean change of each cell times its share of usable pixels, and that share.

    Args:
        small: as for :func:`collect_ratios`, like the next two.
        mean: brightness of the background.
        brightest: its brightest channel.
        around: factors of the level that background lies around, (h, w).
        person: not 0 where the person is.
        level: brightness of the scene as a factor.
        tolerance: a pixel farther from ``around`` than this fraction is not used.
        cells: result, (2, rows, columns).
    """
    cells[:] = 0
    height, width = small.shape
    rows, columns = cells.shape[1:]
    share = np.float32(rows * columns / (height * width))
    for v in range(height):
        for u in range(width):
            ratio = np.float32(small[v, u]) / max(mean[v, u], np.float32(1))
            relative = np.float32(ratio / level)
            known = person[v, u] == 0 and ratio * brightest[v, u] < _BRIGHTEST
            if known and abs(relative / around[v, u] - 1) < tolerance:
                row, column = v * rows // height, u * columns // width
                cells[0, row, column] += share * (relative - 1)
                cells[1, row, column] += share
