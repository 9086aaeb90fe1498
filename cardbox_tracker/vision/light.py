"""Adapts the learned background to changes of the light.

Slow drift, an automatic gain or a lamp multiply the background by a factor that varies slowly over
the image: one level for the whole image times a coarse field. Both are estimated from pixels
outside the person, so that a person who stands still does not become background. Light has no
outline, so foreground into which the brightness passes smoothly from the background is used as
well; without this, a corner that a lamp made foreground would stay foreground and grow.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.array_checks import ANY, check_array
from cardbox_tracker.vision.chroma import bgr_of
from cardbox_tracker.vision.light_samples import CUT_OFF, collect_ratios, limit_channels, sum_cells

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# The light is estimated from every fourth pixel of every fourth row.
_GRID = (slice(1, None, 4), slice(1, None, 4))
# Cells of the coarse field, and the standard deviation of its smoothing, cells.
_CELLS = (20, 15)
_SMOOTHING_CELLS = 2.0
# Darker pixels carry no information about the light, grey levels.
_DARKEST = 10.0
# A field within this of 1 is ignored.
_SAME = 0.004
# Weights of blue, green and red in the brightness.
_WEIGHTS = np.array([0.114, 0.587, 0.299], np.float32)
_GREY = np.ones(1, np.float32)
# The field is estimated in every third image, and in every one after a step; the level always.
_EVERY = 3
# Share of the new estimate in the field, an exponential moving average.
_RATE = 1.0 - 0.9**_EVERY
# Pixels whose brightness differs from the expected one by more are not background.
_TOLERANCE, _TOLERANCE_AFTER_STEP = 0.1, 0.4
# A larger change of the level between two images is a step of the light: a lamp, a gain.
_STEP = 0.04
# For this many images after a step the field is not averaged and the earlier person is kept.
_SETTLING = 8
# Smallest share of pixels that must be background.
_ENOUGH = 0.15
# Weight of the assumption of no change, as a share of a cell's pixels.
_DOUBT = 0.02
_LEAST = 1e-3
_KERNEL = np.ones((5, 5), np.uint8)
# More foreground than a person covers: the light has changed, not the scene.
_COVERAGE = 0.5
# Light varies by less than this fraction within 12 px; an outline does not.
_SOFT = 0.06
# With more foreground than this caused by light, the field is estimated as after a step.
_LIT = 0.01
_AROUND = np.ones((3, 3), np.uint8)


class LightFollower:
    """Estimates the present brightness of each pixel of the background.

    Attributes:
        level: brightness of the scene relative to the learned background.
    """

    def __init__(self, mean: FloatImage, chroma: FloatImage | None = None) -> None:
        """Start with the light of the learned background.

        Args:
            mean: mean brightness of the background, (H, W) float32.
            chroma: its brightness, Cr and Cb at any resolution, (3, h, w); None if it is grey.

        Raises:
            ValueError: an array has another shape or type, or the background is narrower or lower
                than 2 px.
        """
        check_array("mean", mean, (ANY, ANY), np.float32)
        if chroma is not None:
            check_array("chroma", chroma, (3, ANY, ANY), np.float32)
        if min(mean.shape) < 2:
            raise ValueError(
                f"the background has the shape {mean.shape}; expected 2x2 px or more: learn it "
                "from larger images"
            )
        self._prepare(mean, chroma)
        self._ratios = np.empty(self._size[0] * self._size[1], np.float32)
        self._cells = np.zeros((2, *_CELLS[::-1]), np.float32)
        self.restart()

    def replace(self, mean: FloatImage, chroma: FloatImage | None = None) -> None:
        """Use another background of the same size and keep the estimate of the light."""
        self._prepare(mean, chroma)
        self._spread()

    def factors(self) -> FloatImage:
        """Return the present brightness (H, W) relative to the learned background."""
        field = cv2.resize(self._field, self._mean.shape[::-1])
        return np.asarray(self.level * field, np.float32)

    def _prepare(self, mean: FloatImage, chroma: FloatImage | None) -> None:
        self._small = np.ascontiguousarray(mean[_GRID], np.float32)
        self._size = self._small.shape[1], self._small.shape[0]
        self._mean = mean
        blocks = cv2.resize(mean, self._size, interpolation=cv2.INTER_AREA)
        self._blocks = np.maximum(blocks, np.float32(_DARKEST))
        self._now, self._scaled = np.empty_like(mean), np.empty_like(mean)
        channels = mean[None]
        if chroma is not None:
            planes = [cv2.resize(one, mean.shape[::-1]) for one in chroma[1:]]
            channels = bgr_of(np.stack([mean, *planes]))
        self._channels = channels.reshape(len(channels), -1)
        self._brightest = self._channels.max(axis=0)
        brightest = self._brightest.reshape(mean.shape)[_GRID]
        # Ratios of dark pixels are noise, so these are never used.
        self._small_brightest = np.where(self._small > _DARKEST, brightest, np.inf).astype(
            np.float32
        )
        self._highest = float(self._brightest.max())

    def restart(self) -> None:
        """Forget the light and the person, since the next image may be from any other time."""
        self.level = 1.0
        self._field = np.ones(_CELLS[::-1], np.float32)
        self._base = np.ones_like(self._field)
        self._fine = np.ones(self._size[::-1], np.float32)
        self._person = np.zeros(self._size[::-1], np.uint8)
        self._settling, self._is_lit = 0, False
        # The silhouette since the step, without the foreground caused by light.
        self._passing: ImageArray | None = None
        self._lit = np.zeros(self._size[::-1], np.bool_)
        self._brightness = np.zeros(self._mean.shape, np.uint8)
        self._started = False
        self._images = 0
        self._relative, self._highest_field = self._mean, 1.0

    def expect_step(self) -> None:
        """Use the next estimate of the field without averaging, as after a step of the light."""
        self._settling = max(self._settling, 1)

    def follow(self, brightness: ImageArray) -> tuple[FloatImage, float]:
        """Return the background (H, W) and a factor, whose product has the present brightness.

        Args:
            brightness: brightness of an image, (H, W) uint8.

        Returns:
            The background, an array that the next call may change, and the factor.
        """
        check_array("brightness", brightness, self._mean.shape)
        self._estimate(brightness)
        if self.level * self._highest_field * self._highest < CUT_OFF:
            return self._relative, self.level
        self._cut_off()
        return self._now, 1.0

    @property
    def is_settling(self) -> bool:
        """Whether a step of the light was so recent that its estimate is uncertain."""
        return self._settling > 0

    def _cut_off(self) -> None:
        """Compute the expected brightness, limited to the range of the camera's channels."""
        limit = np.float32(CUT_OFF / (self.level * self._highest_field))
        light = self._relative.ravel(), np.float32(self.level), limit
        parts = self._mean.ravel(), self._channels, self._brightest
        weights = _WEIGHTS if len(self._channels) == 3 else _GREY
        limit_channels(light, *parts, weights, self._now.ravel())

    def _estimate(self, brightness: ImageArray) -> None:
        small = np.ascontiguousarray(brightness[_GRID])
        self._brightness = brightness
        parts = small, self._small, self._small_brightest
        ratios = self._ratios
        count = collect_ratios(*parts, self._fine, self._person, ratios)
        if count < _ENOUGH * ratios.size:
            count = collect_ratios(*parts, self._fine, np.zeros_like(self._person), ratios)
        if count == 0:
            return
        level = max(float(np.partition(ratios[:count], count // 2)[count // 2]), _LEAST)
        if self._started and abs(level / self.level - 1.0) > _STEP:
            if self._settling == 0:
                self._base = np.ones_like(self._field)
            self._settling = _SETTLING
        self._started = True
        self.level = level
        number, self._images = self._images, self._images + 1
        if number % _EVERY and self._settling == 0 and not self._is_lit:
            return
        person, rate, tolerance, around = self._person, _RATE, _TOLERANCE, self._fine
        if self._settling > 0:
            # The person may have moved since.
            known = person if self._passing is None else person | self._passing
            person = cv2.dilate(known, _KERNEL).reshape(person.shape)
        if self._settling > 0 or self._is_lit:
            rate, tolerance = 1.0, _TOLERANCE_AFTER_STEP
        base = cv2.resize(self._base, self._size)
        sum_cells(parts, around, base, person, level, tolerance, self._cells)
        change, weight = (cv2.GaussianBlur(c, (0, 0), _SMOOTHING_CELLS) for c in self._cells)
        # Cells without known pixels do not change.
        goal = self._base * (1.0 + change / (weight + _DOUBT))
        self._field += np.float32(rate) * (goal - self._field)
        if self._is_lit:
            # The next estimate is relative to this one and adds the remainder of the smoothing.
            self._base = self._field.copy()
        self._fine = cv2.resize(self._field, self._size).reshape(small.shape)
        self._spread()

    def _spread(self) -> None:
        """Multiply the background by the field."""
        self._highest_field = float(self._field.max())
        if self._highest_field < 1.0 + _SAME and float(self._field.min()) > 1.0 - _SAME:
            self._relative = self._mean
        else:
            field = cv2.resize(self._field, self._mean.shape[::-1])
            cv2.multiply(self._mean, field, dst=self._scaled)
            self._relative = self._scaled

    def exclude(self, silhouette: ImageArray) -> None:
        """Exclude the person, given the silhouette (H, W) of the last image."""
        check_array("silhouette", silhouette, self._mean.shape)
        if cv2.countNonZero(silhouette) > _COVERAGE * silhouette.size:
            self._settling = _SETTLING - 1
            return
        person = np.ascontiguousarray(silhouette[_GRID])
        # Smooth foreground is searched as often as the field is estimated, before it.
        if self._settling > 0 or self._is_lit or self._images % _EVERY == 0:
            smooth, brighter = self._smooth_from_background(person)
            # Darker pixels may be the person's shadow, which moves with the person.
            self._lit = smooth & brighter
            self._is_lit = bool(np.count_nonzero(self._lit) > _LIT * smooth.size)
        if self._settling > 0:
            self._settling -= 1
            person[smooth] = 0
            self._passing = person
            return
        person[self._lit] = 0
        self._passing = None
        self._person = cv2.dilate(person, _KERNEL).reshape(person.shape)

    def _smooth_from_background(
        self, person: ImageArray
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return masks (h, w) of foreground without an outline and of its brighter part.

        Args:
            person: foreground of the last image, (h, w), not 0 where set.
        """
        relative = cv2.resize(self._brightness, self._size, interpolation=cv2.INTER_AREA) / (
            self._blocks * self._fine * np.float32(self.level)
        )
        varies = cv2.dilate(relative, _AROUND) - cv2.erode(relative, _AROUND)
        count, labels = cv2.connectedComponents((varies < _SOFT).astype(np.uint8), connectivity=4)
        reached = np.bincount(labels[person == 0], minlength=count) > 0
        reached[0] = False
        return reached[labels] & (person > 0), relative > 1.0
