"""How far the colours of an image are from those of the empty scene, whatever its brightness.

A shadow darkens all channels alike: the chroma (Cr, Cb) shrinks in proportion to the brightness.
What is left after that proportion is a difference that no shadow makes, and clothes as bright as
the wall still have it. JPEG stores chroma at half the resolution and smears it over blocks, so it
is compared at half the resolution, and its outline is put where it falls to a fraction of its
highest value nearby: halfway down a smeared edge is where the edge was.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.vision.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Mean over so many pixels, at half the resolution.
_SMOOTHING = (3, 3)
# How far around a pixel the highest difference is looked for: half of a JPEG chroma block.
_REACH_PX = 3
_WINDOW = np.ones((2 * _REACH_PX + 1, 2 * _REACH_PX + 1), np.uint8)
_NEUTRAL = 128.0
# Dark pixels have hardly any colour: the proportion below this brightness is not trusted.
_DARKEST = 8.0
_RATIOS = (0.2, 1.6)
# A channel that the camera cuts off at 255 changes the colour: it is expected from here on.
_CUT_OFF = 245.0
# Pixels whose medians say how the white balance has changed, and the strongest change.
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


def _small(image: ImageArray) -> ImageArray:
    """Return the same as pixels (h, w, 3)."""
    height, width = image.shape[:2]
    size = (max(width // 2, 1), max(height // 2, 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.blur(cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb), _SMOOTHING), np.uint8)


def bgr_of(planes: FloatImage) -> FloatImage:
    """Return blue, green, red (3, h, w), not cut off, of brightness, Cr and Cb (3, h, w)."""
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
            threshold: standard deviations from which on a difference counts.
            min_contrast: smallest difference that counts, grey levels.
            edge: fraction of the highest score nearby that the outline is put at.
            follow: allow for a white balance that has changed.
            before: what compared the images so far, whose white balance still holds.
        """
        self._mean = model.mean
        limits = np.maximum(threshold * model.stddev[1:], min_contrast)
        self._weights = np.asarray(1.0 / limits, np.float32)
        # Beside a bright place, averaged pixels have something of it.
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
        """Return a margin for a bgr image (H, W, 3): not negative where it is foreground.

        Args:
            image: of the size of those learned.
            window: where the margin is wanted, its edges at even places. Without it all of the
                image is looked at, also for its white balance.

        Returns:
            (H, W), or of the window's size.
        """
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
        """Return colours seen now, in the white balance that the scene was learned in."""
        cast = np.array([0.0, *self._cast], np.float32)[:, None, None]
        return ChromaModel(model.mean - cast * model.mean[0], model.stddev)

    def _see_cast(self, colors: ImageArray) -> None:
        """Find Cr and Cb that the white balance has added, as shares of the brightness.

        Medians over the image: the person covers less than half of it.
        """
        _collect_shares(np.ascontiguousarray(colors[self._grid]), self._known, self._shares)
        middle = self._shares.shape[1] // 2
        shares = np.partition(self._shares, middle, axis=1)[:, middle]
        red, blue = np.clip(shares, -_STRONGEST_CAST, _STRONGEST_CAST).astype(np.float32)
        self._cast = red, blue


@njit(cache=True, nogil=True, error_model="numpy")
def _collect_shares(colors: Any, known: Any, shares: Any) -> None:
    """Write by how much Cr and Cb of each sample differ from what is known, over its brightness."""
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
    """Distance of each pixel's chroma from the background's, in units of its limit.

    The colours are those of a part that begins at the row and column ``place`` of the model.
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
    """Turn the score into how far it is above 1 and above its part of the highest nearby."""
    one = np.float32(1)
    height, width = score.shape
    for v in range(height):
        for u in range(width):
            value = score[v, u]
            score[v, u] = min(value - one, value - edge * highest[v, u])
