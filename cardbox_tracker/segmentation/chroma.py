"""Compares the chroma of an image with that of the empty scene, independent of brightness.

A shadow darkens all channels alike, so the chroma (Cr, Cb) shrinks in proportion to the brightness.
A difference that remains after this proportion is removed is not a shadow, and it shows clothes
that are as bright as the wall. JPEG stores chroma at half the resolution and smears it over blocks.
Chroma is therefore compared at half the resolution, and the outline is put where the difference
falls to a fraction of its maximum nearby.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.segmentation.chroma_kernels import (
    DARKEST,
    NEUTRAL,
    collect_shares,
    find_colors,
    rate_colors,
)
from cardbox_tracker.segmentation.color_reader import halved
from cardbox_tracker.segmentation.shadows import decide_pixels
from cardbox_tracker.segmentation.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Kernel of the mean filter, px at half the resolution.
_SMOOTHING = (3, 3)
# Number of pixels whose medians estimate the white balance, and its largest change.
_SAMPLES = 1200
_STRONGEST_CAST = 0.2


class ChromaModel(NamedTuple):
    """Mean and standard deviation of the empty scene's planes, each (3, h, w) float32.

    The planes are brightness, Cr and Cb (the last two around 128) at half the resolution, smoothed.
    """

    mean: FloatImage
    stddev: FloatImage


def chroma_planes(image: ImageArray) -> ImageArray:
    """Return brightness, Cr and Cb (3, h, w) of a bgr image (H, W, 3), at half its resolution."""
    smooth = np.asarray(cv2.blur(halved(image), _SMOOTHING), np.uint8)
    return np.ascontiguousarray(smooth.transpose(2, 0, 1))


def bgr_of(planes: FloatImage) -> FloatImage:
    """Convert brightness, Cr and Cb (3, h, w) to blue, green and red (3, h, w), not clipped."""
    brightness, red_part, blue_part = planes[0], planes[1] - NEUTRAL, planes[2] - NEUTRAL
    red = brightness + 1.403 * red_part
    blue = brightness + 1.773 * blue_part
    green = brightness - 0.714 * red_part - 0.344 * blue_part
    return np.stack([blue, green, red]).astype(np.float32)


class ChromaScore:
    """Compares images with one learned :class:`ChromaModel`."""

    def __init__(
        self,
        model: ChromaModel,
        threshold: float,
        min_contrast: float,
        edge: float,
        follow: bool = False,
        before: ChromaScore | None = None,
    ) -> None:
        """Prepare the limits of every pixel of the empty scene ``model``.

        The smallest difference that counts is ``threshold``, in standard deviations, and
        ``min_contrast``, grey levels; the outline is put at the fraction ``edge`` of the highest
        score nearby. With ``follow`` a change of the white balance is compensated, whose estimate
        that of the score ``before`` begins. Raises ValueError unless mean and standard deviation
        are of one shape (3, h, w) with pixels.
        """
        mean = model.mean
        check_array("mean", mean, (3, ANY, ANY), np.float32)
        check_array("stddev", model.stddev, mean.shape, np.float32)
        if not mean.size:
            raise ValueError(f"mean has the shape {mean.shape}; expected pixels")
        limits = np.maximum(threshold * model.stddev[1:], min_contrast)
        # Averaging mixes a bright place into its neighbours.
        highest = cv2.dilate(bgr_of(mean).max(axis=0), np.ones(_SMOOTHING, np.uint8))
        planes = (
            1.0 / np.maximum(mean[:1], DARKEST),
            mean[1:] - NEUTRAL,
            1.0 / limits,
            np.reshape(highest, (1, *mean.shape[1:])),
        )
        self._background = np.concatenate(planes).astype(np.float32)
        self._edge = edge
        size = mean[0].size
        self._step = step = max(1, round((size / _SAMPLES) ** 0.5))
        samples = mean[0, step // 2 :: step, step // 2 :: step].size
        self._shares = np.empty((2, samples if follow else 0), np.float32)
        self._cast = 0.0, 0.0
        if before is not None:
            self._cast = before._cast
        # Allocation takes longer than the arithmetic.
        self._score, self._margin = np.empty(size, np.float32), np.empty(size, np.float32)
        self._mask = np.empty(4 * size, np.uint8)

    def __call__(
        self, colors: ImageArray, size: tuple[int, ...], window: Window | None = None
    ) -> ImageArray:
        """Return a mask of the pixels of an image of this size whose colour differs, 255, else 0.

        ``colors``, (3, h, w), are brightness, Cr and Cb at half its resolution, as
        :class:`~cardbox_tracker.segmentation.color_reader.ColorReader` has them. The part in
        ``window``, with even edges, is compared; without it the whole image is, and its white
        balance is estimated. The mask has the size of that, and the next call may change it.

        Raises ValueError if colours or size are not those of the learned images, or the window is
        empty, not in the image, or has odd edges.
        """
        half = self._background.shape[1:]
        check_array("colors", colors, (3, *half))
        if min(size) < 1 or half != (max(size[0] // 2, 1), max(size[1] // 2, 1)):
            raise ValueError(f"an image of {size} px does not have colours of {half} px")
        if window is None:
            if self._shares.size:
                self._see_cast(colors)
            return self._compared(colors, (0, 0), size)
        _check(window, size, 2)
        sides = window.bottom - window.top, window.right - window.left
        return self._compared(colors, (window.top // 2, window.left // 2), sides)

    def decide(
        self,
        colors: ImageArray,
        foreground: ImageArray,
        difference: FloatImage,
        per_level: FloatImage,
        shadow: tuple[float, float],
        window: Window | None = None,
    ) -> None:
        """Add coloured pixels to ``foreground`` and remove soft shadows from it, in place.

        This does in one call what :meth:`__call__` and
        :func:`~cardbox_tracker.segmentation.shadows.decide_shadows` do, and takes and refuses what
        they do; H and W are even.
        """
        _, rows, columns = self._background.shape
        shape = 2 * rows, 2 * columns
        check_array("colors", colors, (3, rows, columns))
        check_array("foreground", foreground, shape, is_written=True)
        check_array("difference", difference, shape, np.float32, is_written=True)
        check_array("per_level", per_level, shape, np.float32, is_written=True)
        if window is None:
            window = Window(0, shape[0], 0, shape[1])
            if self._shares.size:
                self._see_cast(colors)
        else:
            _check(window, shape, 2 if shape[1] % 8 else 8)
        _decide_with_colors(
            *(colors, self._background, *self._cast, self._edge),
            *(self._score, self._margin, self._mask, foreground, difference, per_level),
            *(*shadow, *window),
        )

    def _compared(
        self, colors: ImageArray, place: tuple[int, int], sides: tuple[int, ...]
    ) -> ImageArray:
        """Return the mask of a part of the height and width ``sides`` whose colours begin there."""
        height, width = half = max(sides[0] // 2, 1), max(sides[1] // 2, 1)
        count = height * width
        rated = (*place, *half, self._background, *self._cast, self._edge)
        if sides != (2 * height, 2 * width):
            rate_colors(colors, *rated, self._score, self._margin)
            margin = self._margin[:count].reshape(half)
            whole = cv2.resize(margin, (sides[1], sides[0]))
            return np.asarray(cv2.inRange(whole, 0.0, np.inf), np.uint8)
        find_colors(colors, *rated, self._score, self._margin, self._mask)
        return self._mask[: 4 * count].reshape(sides)

    def without_cast(self, model: ChromaModel) -> ChromaModel:
        """Convert colours of the present white balance to that of the learned scene."""
        cast = np.array([0.0, *self._cast], np.float32)[:, None, None]
        return ChromaModel(model.mean - cast * model.mean[0], model.stddev)

    def _see_cast(self, colors: ImageArray) -> None:
        """Estimate the Cr and Cb that the white balance has added, as shares of the brightness.

        Medians over the image are used, since the person covers less than half of it.
        """
        collect_shares(colors, self._background, self._step, self._shares)
        middle = self._shares.shape[1] // 2
        medians = np.partition(self._shares, middle, axis=1)[:, middle]
        red, blue = np.clip(medians, -_STRONGEST_CAST, _STRONGEST_CAST)
        self._cast = float(red), float(blue)


def _check(window: Window, shape: tuple[int, ...], unit: int) -> None:
    """Refuse a window that is empty, or not at even rows and columns in steps of ``unit`` px."""
    window.check_within(shape, unit)
    if window.is_empty or window.top % 2 or window.bottom % 2:
        raise ValueError(f"{window} is empty or has odd edges; expected neither")


@kernel
def _decide_with_colors(
    colors: Any,
    background: Any,
    red_cast: Any,
    blue_cast: Any,
    edge: Any,
    score: Any,
    margin: Any,
    mask: Any,
    foreground: Any,
    difference: Any,
    per_level: Any,
    darkest: Any,
    softest: Any,
    top: Any,
    bottom: Any,
    left: Any,
    right: Any,
) -> None:
    """Compare a window by colour, and decide about shadows in it."""
    height, width = bottom - top, right - left
    find_colors(
        *(colors, top // 2, left // 2, height // 2, width // 2),
        *(background, red_cast, blue_cast, edge, score, margin, mask),
    )
    colored = mask[: height * width].reshape((height, width))
    decide_pixels(
        foreground, colored, difference, per_level, -darkest, softest, top, bottom, left, right
    )
