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

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.segmentation.chroma import DARKEST, bgr_of
from cardbox_tracker.segmentation.regions import SQUARE, flooded
from cardbox_tracker.segmentation.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Weight of the assumption of no change, as a share of a cell's pixels.
_DOUBT = 0.02
# A channel above this may be saturated, so the pixel may be brighter than it seems.
_CUT_OFF = 250.0
# The light is estimated from every fourth pixel of every fourth row.
_GRID = (slice(1, None, 4), slice(1, None, 4))
# Columns and rows of the cells of the coarse field, and the Gaussian that smooths them, with a
# standard deviation of two cells.
_CELLS = (20, 15)
_GAUSSIAN = cv2.getGaussianKernel(17, 2.0, cv2.CV_32F)
# A field within this of 1 is ignored.
_SAME = 0.004
# Weights of blue, green and red in the brightness.
_WEIGHTS = np.array([0.114, 0.587, 0.299], np.float32)
# The field is estimated in every third image, and in every one after a step; the level always.
_EVERY = 3
# Pixels whose brightness differs from the expected one by more are not background.
_TOLERANCE, _TOLERANCE_AFTER_STEP = 0.1, 0.4
# A larger change of the level between two images is a step of the light: a lamp, a gain.
_STEP = 0.04
# For this many images after a step the field is not averaged and the earlier person is kept.
_SETTLING = 8
# Smallest share of pixels that must be background.
_ENOUGH = 0.15
LEAST_LEVEL = 1e-3
"""Least brightness of the scene relative to the learned background."""
# Light varies by less than this fraction within the square of 12 px; an outline does not.
_SOFT = 0.06
# More foreground than a person covers: the light has changed, not the scene.
_COVERAGE = 0.5
# With more foreground than this caused by light, the field is estimated as after a step.
_LIT = 0.01


class LightFollower:
    """Estimates the present brightness of each pixel of the background.

    Attributes:
        level: brightness of the scene relative to the learned background.
    """

    def __init__(self, mean: FloatImage, chroma: FloatImage | None = None) -> None:
        """Start with the light of the learned background, whose mean brightness (H, W) is float32.

        ``chroma`` are its brightness, Cr and Cb at any resolution, (3, h, w), or None. Raises
        ValueError for another shape or type, or less than 2 px a side.
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
        self._samples = np.empty(self._small.shape, np.uint8)
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
        self._blocks = np.maximum(blocks, np.float32(DARKEST))
        self._now, self._scaled = np.empty_like(mean), np.empty_like(mean)
        channels = mean[None]
        if chroma is not None:
            planes = [cv2.resize(one, mean.shape[::-1]) for one in chroma[1:]]
            channels = bgr_of(np.stack([mean, *planes]))
        self._channels = channels.reshape(len(channels), -1)
        self._brightest = self._channels.max(axis=0)
        brightest = self._brightest.reshape(mean.shape)[_GRID]
        # Ratios of dark pixels are noise, so these are never used.
        self._small_brightest = np.where(self._small > DARKEST, brightest, np.inf).astype(
            np.float32
        )
        self._highest = float(self._brightest.max())

    def restart(self) -> None:
        """Forget the light and the person, since the next image may be from any other time."""
        self.level = 1.0
        self._field = np.ones(_CELLS[::-1], np.float32)
        self._base = np.ones_like(self._field)
        self._base_fine = self._fine_of(self._base)
        self._fine = np.ones(self._size[::-1], np.float32)
        self._person = np.zeros(self._size[::-1], np.uint8)
        self._settling, self._is_lit = 0, False
        # The silhouette since the step, without the foreground caused by light.
        self._passing: ImageArray | None = None
        self._lit = np.zeros(self._size[::-1], np.bool_)
        self._brightness = np.zeros(self._mean.shape, np.uint8)
        self._started = False
        self._images = 0
        self._extremes = 1.0, 1.0
        self._relative, self._highest_field = self._mean, 1.0

    def expect_step(self) -> None:
        """Use the next estimate of the field without averaging, as after a step of the light."""
        self._settling = max(self._settling, 1)

    def follow(self, brightness: ImageArray) -> tuple[FloatImage, float]:
        """Return the background (H, W) and a factor, whose product is as bright as an image (H, W).

        The next call may change the background.
        """
        check_array("brightness", brightness, self._mean.shape)
        self._estimate(brightness)
        if self.level * self._highest_field * self._highest < _CUT_OFF:
            return self._relative, self.level
        self._cut_off()
        return self._now, 1.0

    @property
    def is_settling(self) -> bool:
        """Whether a step of the light was so recent that its estimate is uncertain."""
        return self._settling > 0

    def _cut_off(self) -> None:
        """Compute the expected brightness, limited to the range of the camera's channels."""
        limit = np.float32(_CUT_OFF / (self.level * self._highest_field))
        weights = _WEIGHTS if len(self._channels) == 3 else (1.0,)
        np.multiply(self._relative, np.float32(self.level), out=self._now)
        now, mean = self._now.reshape(-1), self._mean.reshape(-1)
        bright = np.flatnonzero(self._brightest > limit)
        factors = now[bright] / np.maximum(mean[bright], 1.0)
        limited = zip(weights, self._channels, strict=True)
        now[bright] = sum(w * np.minimum(one[bright] * factors, 255.0) for w, one in limited)

    def _estimate(self, brightness: ImageArray) -> None:
        self._brightness = brightness
        self._samples = brightness[_GRID]
        measured = self._measured_level()
        if not measured >= 0.0:
            return
        level = max(measured, LEAST_LEVEL)
        if self._started and abs(level / self.level - 1.0) > _STEP:
            if self._settling == 0:
                self._base = np.ones_like(self._field)
                self._base_fine = self._fine_of(self._base)
            self._settling = _SETTLING
        self._started = True
        self.level = level
        number, self._images = self._images, self._images + 1
        if number % _EVERY and self._settling == 0 and not self._is_lit:
            return
        person, rate, tolerance, around = self._person, 1.0 - 0.9**_EVERY, _TOLERANCE, self._fine
        if self._settling > 0:
            # The person may have moved since.
            known = person if self._passing is None else person | self._passing
            person = cv2.dilate(known, SQUARE, iterations=2).reshape(person.shape)
        if self._settling > 0 or self._is_lit:
            rate, tolerance = 1.0, _TOLERANCE_AFTER_STEP
        cells = self._cells(around, person, tolerance)
        cells = np.asarray(cv2.sepFilter2D(cells, -1, _GAUSSIAN, _GAUSSIAN), np.float32)
        # Cells without known pixels do not change.
        goal = self._base * (1.0 + cells[..., 0] / (cells[..., 1] + np.float32(_DOUBT)))
        self._field += np.float32(rate) * (goal - self._field)
        self._extremes = float(self._field.min()), float(self._field.max())
        if self._is_lit:
            # The next estimate is relative to this one and adds the remainder of the smoothing.
            self._base = self._field.copy()
            self._base_fine = self._fine_of(self._base)
        self._fine = self._fine_of(self._field)
        self._spread()

    def _measured_level(self) -> float:
        """Return the median relative brightness outside the person; -1 without usable pixels.

        Where too few pixels outside the person are within the camera's range, the saturated ones
        count too, with their least brightness; where there are too few of these, the person's.
        """
        ratios = self._samples / np.maximum(self._small, np.float32(1))
        with np.errstate(invalid="ignore"):
            highest = ratios * self._small_brightest
        known, outside = highest < _CUT_OFF, self._person == 0
        bright = outside & (highest < np.inf)
        enough = _ENOUGH * known.size
        if np.count_nonzero(known & outside) >= enough:
            found = (ratios / self._fine)[known & outside]
        elif np.count_nonzero(bright) >= enough:
            # The field is no share of a lower bound.
            found = ratios[bright]
        else:
            found = (ratios / self._fine)[known]
        middle = len(found) // 2
        return float(np.partition(found, middle)[middle]) if len(found) else -1.0

    def _cells(self, around: FloatImage, person: ImageArray, tolerance: float) -> FloatImage:
        """Return each cell's mean change times its share of usable pixels, and that share.

        Pixels that differ from the expected factors ``around`` (h, w) by more than the fraction
        ``tolerance``, and those of the ``person`` (h, w), are not used.
        """
        ratios = self._samples / np.maximum(self._small, np.float32(1))
        relative = ratios / np.float32(self.level)
        change = relative / around - np.float32(1)
        with np.errstate(invalid="ignore"):
            is_cut_off = ratios * self._small_brightest >= _CUT_OFF
        # A saturated pixel gives only a lower bound.
        is_known = ~is_cut_off | ((change > 0) & (self._small_brightest < np.inf))
        is_used = (person == 0) & is_known & (np.abs(change) < np.float32(tolerance))
        changes = np.where(is_used, relative / self._base_fine - np.float32(1), np.float32(0))
        both = np.dstack([changes, is_used.astype(np.float32)])
        return np.asarray(cv2.resize(both, _CELLS, interpolation=cv2.INTER_AREA))

    def _fine_of(self, field: FloatImage) -> FloatImage:
        """Return a field at the resolution of the samples, (h, w)."""
        return np.asarray(cv2.resize(field, self._size), np.float32).reshape(self._small.shape)

    def _spread(self) -> None:
        """Multiply the background by the field, interpolated between cells."""
        lowest, self._highest_field = self._extremes
        if self._highest_field < 1.0 + _SAME and lowest > 1.0 - _SAME:
            self._relative = self._mean
            return
        field = cv2.resize(self._field, self._mean.shape[::-1])
        np.multiply(self._mean, field, out=self._scaled)
        self._relative = self._scaled

    def exclude(self, silhouette: ImageArray, window: Window | None = None) -> None:
        """Exclude the person: the silhouette (H, W) of the last image, all of it in ``window``."""
        check_array("silhouette", silhouette, self._mean.shape)
        least = _COVERAGE * silhouette.size
        if (window is None or window.area_px > least) and cv2.countNonZero(silhouette) > least:
            self._settling = _SETTLING - 1
            return
        if self._settling > 0 or self._is_lit or self._images % _EVERY == 0:
            # Darker pixels may be the person's shadow, which moves with the person.
            smooth = self._find_smooth(silhouette)
            self._is_lit = bool(np.count_nonzero(self._lit) > _LIT * self._lit.size)
        if self._settling > 0:
            self._settling -= 1
            self._passing = np.where(smooth, np.uint8(0), silhouette[_GRID])
            return
        person = np.where(self._lit, np.uint8(0), silhouette[_GRID])
        self._person = np.asarray(cv2.dilate(person, SQUARE, iterations=2), np.uint8).reshape(
            person.shape
        )
        self._passing = None

    def _find_smooth(self, silhouette: ImageArray) -> NDArray[np.bool_]:
        """Return the samples (h, w) of a silhouette (H, W) into which the background passes.

        Those that are brighter than the background are lit.
        """
        shape = self._small.shape
        means = cv2.resize(self._brightness, self._size, interpolation=cv2.INTER_AREA)
        now = np.asarray(means, np.float32).reshape(shape)
        relative = now / (self._blocks * self._fine * np.float32(self.level))
        varies = cv2.dilate(relative, SQUARE) - cv2.erode(relative, SQUARE)
        is_even = varies.reshape(shape) < np.float32(_SOFT)
        is_hidden = silhouette[_GRID] > 0
        smooth = is_hidden & flooded(~is_hidden, is_even)
        self._lit = smooth & (relative > 1.0)
        return smooth
