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

from cardbox_tracker.compiling import njit
from cardbox_tracker.vision.array_checks import ANY, check_array
from cardbox_tracker.vision.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Kernel of the mean filter, px at half the resolution.
_SMOOTHING = (3, 3)
# Radius within which the highest difference is searched: half of a JPEG chroma block.
_REACH_PX = 3
_WINDOW = np.ones((2 * _REACH_PX + 1, 2 * _REACH_PX + 1), np.uint8)
_NEUTRAL = 128.0
# Dark pixels have hardly any colour, so brightness ratios are limited below this brightness.
_DARKEST = 8.0
_RATIOS = (0.2, 1.6)
# A channel above this may be saturated, which changes the colour.
_CUT_OFF = 245.0
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
    return np.ascontiguousarray(_small(image).transpose(2, 0, 1))


def half_size(image: NDArray[Any]) -> tuple[int, int]:
    """Return the rows and columns of an image (H, W, ...) at half its resolution."""
    height, width = image.shape[:2]
    return max(height // 2, 1), max(width // 2, 1)


def _small(image: ImageArray) -> ImageArray:
    """Return brightness, Cr and Cb (h, w, 3) uint8, smoothed, at half the resolution."""
    height, width = half_size(image)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.blur(cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb), _SMOOTHING), np.uint8)


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
        """Prepare the limits of every pixel.

        Args:
            model: the empty scene.
            threshold: smallest difference that counts, in standard deviations.
            min_contrast: smallest difference that counts, grey levels.
            edge: fraction of the highest score nearby at which the outline is put.
            follow: compensate a change of the white balance.
            before: the previous score, whose estimate of the white balance is kept.

        Raises:
            ValueError: mean and standard deviation differ in shape.
        """
        for name, planes in model._asdict().items():
            check_array(name, planes, (3, *np.shape(model.mean)[1:]), np.float32)
        self._mean = model.mean
        limits = np.maximum(threshold * model.stddev[1:], min_contrast)
        self._weights = np.asarray(1.0 / limits, np.float32)
        # Averaging mixes a bright place into its neighbours.
        highest = cv2.dilate(bgr_of(model.mean).max(axis=0), np.ones(_SMOOTHING, np.uint8))
        self._brightest = np.asarray(highest, np.float32).reshape(model.mean.shape[1:])
        self._edge = np.float32(edge)
        self._follow = follow
        step = max(1, round((model.mean[0].size / _SAMPLES) ** 0.5))
        self._grid = (slice(step // 2, None, step), slice(step // 2, None, step))
        self._known = np.ascontiguousarray(self._mean[(slice(None), *self._grid)])
        self._shares = np.empty((2, self._known[0].size), np.float32)
        self._cast: tuple[np.float32, np.float32] = (np.float32(0), np.float32(0))
        if before is not None:
            self._cast = before._cast

    def __call__(self, image: ImageArray, window: Window | None = None) -> FloatImage:
        """Return a margin for a bgr image (H, W, 3) uint8, which is >= 0 in the foreground.

        Args:
            image: an image of the size of the learned ones.
            window: part that is compared, with even edges. Without it the whole image is compared
            and its white balance is estimated.

        Returns:
            (H, W), or of the window's size.

        Raises:
            ValueError: the image is not of that size, or the window is empty, not in the image, or
                has odd edges.
        """
        image = np.ascontiguousarray(image)
        check_array("image", image, (ANY, ANY, 3))
        if not image.size or half_size(image) != self._mean.shape[1:]:
            raise ValueError(
                f"an image of the shape {image.shape} does not fit the background's chroma, whose "
                f"shape is {self._mean.shape}"
            )
        if window is not None:
            window.check_within(image.shape, 2)
            if window.is_empty or window.top % 2 or window.bottom % 2:
                raise ValueError(f"{window} is empty or has odd edges; expected neither")
        part = image if window is None else image[window.slices]
        colors = _small(part)
        if window is None and self._follow:
            self._see_cast(colors)
        place = (0, 0) if window is None else (window.top // 2, window.left // 2)
        score = np.empty(colors.shape[:2], np.float32)
        _score(colors, self._mean, self._brightest, self._weights, self._cast, place, score)
        _margin(score, np.asarray(cv2.dilate(score, _WINDOW), np.float32), self._edge)
        return np.asarray(cv2.resize(score, part.shape[1::-1]), np.float32)

    def without_cast(self, model: ChromaModel) -> ChromaModel:
        """Convert colours of the present white balance to that of the learned scene."""
        cast = np.array([0.0, *self._cast], np.float32)[:, None, None]
        return ChromaModel(model.mean - cast * model.mean[0], model.stddev)

    def _see_cast(self, colors: ImageArray) -> None:
        """Estimate the Cr and Cb that the white balance has added, as shares of the brightness.

        Medians over the image are used, since the person covers less than half of it.
        """
        _collect_shares(np.ascontiguousarray(colors[self._grid]), self._known, self._shares)
        middle = self._shares.shape[1] // 2
        shares = np.partition(self._shares, middle, axis=1)[:, middle]
        red, blue = np.clip(shares, -_STRONGEST_CAST, _STRONGEST_CAST).astype(np.float32)
        self._cast = red, blue


@njit(cache=True, nogil=True, error_model="numpy")
def _collect_shares(colors: Any, known: Any, shares: Any) -> None:
    """Write the differences of Cr and Cb from the known values, divided by the brightness."""
    neutral, darkest = np.float32(_NEUTRAL), np.float32(_DARKEST)
    count = 0
    for v in range(known.shape[1]):
        for u in range(known.shape[2]):
            brightness = np.float32(colors[v, u, 0])
            ratio = brightness / max(known[0, v, u], darkest)
            for k in range(2):
                now = np.float32(colors[v, u, k + 1]) - neutral
                added = now - ratio * (known[k + 1, v, u] - neutral)
                shares[k, count] = added / max(brightness, darkest)
            count += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _score(
    colors: Any, mean: Any, brightest: Any, weights: Any, cast: Any, place: Any, score: Any
) -> None:
    """Write the distance of each pixel's chroma from the background's, in units of its limit.

    The colours belong to a part that begins at row and column ``place`` of the model.
    """
    neutral = np.float32(_NEUTRAL)
    darkest = np.float32(_DARKEST)
    lowest, highest = np.float32(_RATIOS[0]), np.float32(_RATIOS[1])
    cut_off, zero = np.float32(_CUT_OFF), np.float32(0)
    top, left = place
    for y in range(colors.shape[0]):
        v = top + y
        for x in range(colors.shape[1]):
            u = left + x
            ratio = np.float32(colors[y, x, 0]) / max(mean[0, v, u], darkest)
            ratio = min(max(ratio, lowest), highest)
            red = np.float32(colors[y, x, 1]) - neutral - ratio * (mean[1, v, u] - neutral)
            blue = np.float32(colors[y, x, 2]) - neutral - ratio * (mean[2, v, u] - neutral)
            red -= cast[0] * np.float32(colors[y, x, 0])
            blue -= cast[1] * np.float32(colors[y, x, 0])
            red *= weights[0, v, u]
            blue *= weights[1, v, u]
            distance = np.sqrt(red * red + blue * blue)
            score[y, x] = distance if ratio * brightest[v, u] < cut_off else zero


@njit(cache=True, nogil=True)
def _margin(score: Any, highest: Any, edge: Any) -> None:
    """Subtract 1, or the fraction ``edge`` of the highest score nearby if that is more."""
    one = np.float32(1)
    height, width = score.shape
    for v in range(height):
        for u in range(width):
            value = score[v, u]
            score[v, u] = min(value - one, value - edge * highest[v, u])
