"""Adapts the learned background to changes of the light.

Slow drift, an automatic gain or a lamp multiply the background by a factor that varies slowly over
the image: one level for the whole image times a coarse field. Both are estimated from pixels
outside the person, so that a person who stands still does not become background. Light has no
outline, so foreground into which the brightness passes smoothly from the background is used as
well; without this, a corner that a lamp made foreground would stay foreground and grow.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.segmentation.chroma import bgr_of
from cardbox_tracker.segmentation.light_outlines import average_blocks, find_smooth, grow_person
from cardbox_tracker.segmentation.light_samples import (
    BLOCK,
    CUT_OFF,
    STEP_PX,
    limit_channels,
    measure_level,
    sum_cells,
    take_samples,
)
from cardbox_tracker.segmentation.window import Window

# Weight of the assumption of no change, as a share of a cell's pixels.
_DOUBT = 0.02
_f32 = np.float32


@kernel
def update_field(cells: Any, base: Any, rate: Any, field: Any) -> Any:
    """Move the field towards the base times the change, and return the field's extremes.

    ``cells`` (h, w, 2) are the smoothed change of each cell times its share of known pixels, and
    that share. The change is relative to ``base`` (h, w); ``rate`` is its share in the ``field``
    (h, w), factors of the level.
    """
    height, width = field.shape
    least, most = _f32(np.inf), _f32(-np.inf)
    for v in range(height):
        for u in range(width):
            # Cells without known pixels do not change.
            change = cells[v, u, 0] / (cells[v, u, 1] + _f32(_DOUBT))
            goal = base[v, u] * (_f32(1) + change)
            value = field[v, u] + rate * (goal - field[v, u])
            field[v, u] = value
            least, most = min(least, value), max(most, value)
    return least, most


@kernel
def multiply_field(mean: Any, field: Any, result: Any) -> None:
    """Write the product of an image (H, W) and the field (h, w), interpolated between cells."""
    height, width = mean.shape
    rows, columns = field.shape
    # The field's rows at the image's width.
    wide = np.empty((rows, width), np.float32)
    for u in range(width):
        near, far, share = _neighbours(u, width, columns)
        for v in range(rows):
            wide[v, u] = field[v, near] + share * (field[v, far] - field[v, near])
    for v in range(height):
        near, far, share = _neighbours(v, height, rows)
        upper, lower, row, out = wide[near], wide[far], mean[v], result[v]
        for u in range(width):
            out[u] = row[u] * (upper[u] + share * (lower[u] - upper[u]))


@inlined_kernel
def _neighbours(index: Any, length: Any, cells: Any) -> Any:
    """Return the two cells around a pixel, and the share of the second one."""
    place = (index + 0.5) * cells / length - 0.5
    place = min(max(place, 0.0), cells - 1.0)
    near = int(place)
    return near, min(near + 1, cells - 1), _f32(place - near)


FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

_GRID = (slice(1, None, STEP_PX), slice(1, None, STEP_PX))
# Columns and rows of the cells of the coarse field, and the Gaussian that smooths them, with a
# standard deviation of two cells.
_CELLS = (20, 15)
_GAUSSIAN = cv2.getGaussianKernel(17, 2.0, cv2.CV_32F)
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
_LEAST = 1e-3
_KERNEL = np.ones((5, 5), np.uint8)
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
        count = self._size[0] * self._size[1]
        self._ratios = np.empty(count + 2, np.float32)
        self._ratio_bits = self._ratios.view(np.int32)
        self._samples = np.empty(self._size[::-1], np.uint8)
        self._means = np.empty(self._size[::-1], np.float32)
        self._smooth = np.zeros(self._size[::-1], np.bool_)
        self._cells = np.zeros((*_CELLS[::-1], 2), np.float32)
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
        starts = np.arange(0, mean.size, BLOCK)
        self._highest_of_blocks = np.maximum.reduceat(self._brightest, starts)

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
        weights = _WEIGHTS if len(self._channels) == 3 else _GREY
        limit_channels(
            *(self._relative.ravel(), np.float32(self.level), limit, self._mean.ravel()),
            *(self._channels, self._brightest, self._highest_of_blocks, weights),
            self._now.ravel(),
        )

    def _estimate(self, brightness: ImageArray) -> None:
        self._brightness = brightness
        measured = measure_level(
            *(brightness, self._samples, self._small, self._small_brightest, self._fine),
            *(self._person, self._ratios, self._ratio_bits, self.level, _ENOUGH),
        )
        if not measured >= 0.0:
            return
        level = max(float(measured), _LEAST)
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
        person, rate, tolerance, around = self._person, _RATE, _TOLERANCE, self._fine
        if self._settling > 0:
            # The person may have moved since.
            known = person if self._passing is None else person | self._passing
            person = cv2.dilate(known, _KERNEL).reshape(person.shape)
        if self._settling > 0 or self._is_lit:
            rate, tolerance = 1.0, _TOLERANCE_AFTER_STEP
        sum_cells(
            *(self._samples, self._small, self._small_brightest, around, self._base_fine),
            *(person, level, tolerance, self._cells),
        )
        cells = cv2.sepFilter2D(self._cells, -1, _GAUSSIAN, _GAUSSIAN)
        self._extremes = update_field(cells, self._base, np.float32(rate), self._field)
        if self._is_lit:
            # The next estimate is relative to this one and adds the remainder of the smoothing.
            self._base = self._field.copy()
            self._base_fine = self._fine_of(self._base)
        self._fine = self._fine_of(self._field)
        self._spread()

    def _fine_of(self, field: FloatImage) -> FloatImage:
        """Return a field at the resolution of the samples, (h, w)."""
        shape = self._size[1], self._size[0]
        return np.asarray(cv2.resize(field, self._size), np.float32).reshape(shape)

    def _spread(self) -> None:
        """Multiply the background by the field."""
        lowest, self._highest_field = (float(extreme) for extreme in self._extremes)
        if self._highest_field < 1.0 + _SAME and lowest > 1.0 - _SAME:
            self._relative = self._mean
        else:
            multiply_field(self._mean, self._field, self._scaled)
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
            count = self._find_smooth(silhouette)
            self._is_lit = count > _LIT * self._lit.size
        if self._settling > 0:
            self._settling -= 1
            self._passing = np.empty(self._size[::-1], np.uint8)
            take_samples(silhouette, self._passing)
            self._passing[self._smooth] = 0
            return
        grow_person(silhouette, self._lit, self._person)
        self._passing = None

    def _find_smooth(self, silhouette: ImageArray) -> int:
        """Find parts of a silhouette (H, W) without an outline; return the brighter ones' size."""
        height, width = self._mean.shape
        quads = None if height % STEP_PX or width % STEP_PX else self._brightness.view(np.uint32)
        if quads is None or not quads.flags.aligned:
            self._means[:] = cv2.resize(
                self._brightness, self._size, interpolation=cv2.INTER_AREA
            ).reshape(self._means.shape)
        else:
            average_blocks(quads, self._means)
        parts = self._means, self._blocks, self._fine, self.level
        return int(find_smooth(*parts, silhouette, self._smooth, self._lit))
