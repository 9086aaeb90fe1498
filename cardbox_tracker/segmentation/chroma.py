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
from cardbox_tracker.segmentation.regions import SQUARE
from cardbox_tracker.segmentation.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Cr and Cb of grey.
_NEUTRAL = 128.0
DARKEST = 8.0
"""Relative differences are noise where the scene is darker than this, grey levels."""
# A channel above this may be saturated, which changes the colour.
_CUT_OFF = 245.0
# Kernel of the mean filter, px at half the resolution.
_SMOOTHING = (3, 3)
# Number of pixels whose medians estimate the white balance.
_SAMPLES = 1200


class ChromaModel(NamedTuple):
    """Mean and standard deviation of the empty scene's planes, each (3, h, w) float32.

    The planes are brightness, Cr and Cb (the last two around 128) at half the resolution, smoothed.
    """

    mean: FloatImage
    stddev: FloatImage


def half_size(image: NDArray[Any]) -> tuple[int, int]:
    """Return the rows and columns of an image (H, W, ...) at half its resolution."""
    height, width = image.shape[:2]
    return max(height // 2, 1), max(width // 2, 1)


def colors_of(image: ImageArray) -> ImageArray:
    """Return brightness, Cr and Cb (3, h, w) of a bgr image (H, W, 3), at half its resolution."""
    small = cv2.resize(image, half_size(image)[::-1], interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb).transpose(2, 0, 1))


def chroma_planes(image: ImageArray) -> ImageArray:
    """Return :func:`colors_of` an image, smoothed."""
    return _smooth(colors_of(image))


def _smooth(planes: ImageArray) -> ImageArray:
    smooth = [np.asarray(cv2.blur(one, _SMOOTHING), np.uint8) for one in planes]
    return np.stack(smooth).reshape(planes.shape)


def bgr_of(planes: FloatImage) -> FloatImage:
    """Convert brightness, Cr and Cb (3, h, w) to blue, green and red (3, h, w), not clipped."""
    brightness, red_part, blue_part = planes[0], planes[1] - _NEUTRAL, planes[2] - _NEUTRAL
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
            mean[1:] - _NEUTRAL,
            1.0 / limits,
            np.reshape(highest, (1, *mean.shape[1:])),
        )
        self._background = np.concatenate(planes).astype(np.float32)
        self._edge = edge
        size = mean[0].size
        step = max(1, round((size / _SAMPLES) ** 0.5))
        self._grid = np.s_[:, step // 2 :: step, step // 2 :: step]
        self._follow = follow
        self._cast = 0.0, 0.0
        if before is not None:
            self._cast = before._cast

    def __call__(
        self, colors: ImageArray, size: tuple[int, ...], window: Window | None = None
    ) -> ImageArray:
        """Return a mask of the pixels of an image of this size whose colour differs, 255, else 0.

        ``colors``, (3, h, w), are brightness, Cr and Cb at half its resolution, as
        :func:`colors_of` has them. The part in ``window``, with even edges, is compared; without it
        the whole image is, and its white balance is estimated. The mask has the size of that.

        Raises ValueError if colours or size are not those of the learned images, or the window is
        empty, not in the image, or has odd edges.
        """
        half = self._background.shape[1:]
        check_array("colors", colors, (3, *half))
        if min(size) < 1 or half != (max(size[0] // 2, 1), max(size[1] // 2, 1)):
            raise ValueError(f"an image of {size} px does not have colours of {half} px")
        if window is None and self._follow:
            self._see_cast(colors)
        if window is None:
            part, sides = (slice(None), slice(None)), size
        else:
            window.check_within(size, 2)
            if window.is_empty:
                raise ValueError(f"{window} is empty; expected pixels")
            part = Window(*(edge // 2 for edge in window)).slices
            sides = window.bottom - window.top, window.right - window.left
        margin = self._margin(colors[:, *part], self._background[:, *part])
        whole = cv2.resize(margin, (sides[1], sides[0]))
        return np.asarray(cv2.inRange(whole, 0.0, np.inf), np.uint8)

    def _margin(self, colors: ImageArray, background: FloatImage) -> FloatImage:
        """Return the margin (h, w) of a part, which is at least 0 in the foreground.

        It is the distance of the chroma from the background's, in units of its limit, less 1 or
        less a fraction of the highest one nearby.
        """
        level, red, blue = _smooth(colors).astype(np.float32)
        inverse, mean_red, mean_blue, weight_red, weight_blue, brightest = background
        cast_red, cast_blue = map(np.float32, self._cast)
        ratio = level * inverse
        red = (red - np.float32(_NEUTRAL) - ratio * mean_red - cast_red * level) * weight_red
        blue = (blue - np.float32(_NEUTRAL) - ratio * mean_blue - cast_blue * level) * weight_blue
        distance = np.sqrt(red * red + blue * blue)
        score = np.where(ratio * brightest < np.float32(_CUT_OFF), distance, np.float32(0))
        # Within half of a JPEG chroma block.
        highest = np.asarray(cv2.dilate(score, SQUARE, iterations=3), np.float32)
        highest = highest.reshape(score.shape)
        margin: FloatImage = np.minimum(score - 1, score - np.float32(self._edge) * highest)
        return margin

    def without_cast(self, model: ChromaModel) -> ChromaModel:
        """Convert colours of the present white balance to that of the learned scene."""
        cast = np.array([0.0, *self._cast], np.float32)[:, None, None]
        return ChromaModel(model.mean - cast * model.mean[0], model.stddev)

    def _see_cast(self, colors: ImageArray) -> None:
        """Estimate the Cr and Cb that the white balance has added, as shares of the brightness.

        Medians over the image are used, since the person covers less than half of it.
        """
        level, red, blue = _smooth(colors)[self._grid].astype(np.float32)
        background = self._background[self._grid]
        ratio, least = level * background[0], np.maximum(level, np.float32(DARKEST))
        parts = (red, background[1]), (blue, background[2])
        shares = [(one - np.float32(_NEUTRAL) - ratio * mean) / least for one, mean in parts]
        middle = shares[0].size // 2
        medians = [np.partition(one, middle, axis=None)[middle] for one in shares]
        self._cast = float(medians[0]), float(medians[1])
