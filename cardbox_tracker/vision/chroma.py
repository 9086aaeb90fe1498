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
    height, width = image.shape[:2]
    size = (max(width // 2, 1), max(height // 2, 1))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    colors = cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb)
    colors = cv2.blur(colors, _SMOOTHING)
    planes = np.empty((3, *colors.shape[:2]), np.uint8)
    cv2.split(colors, tuple(planes))
    return planes


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
    ) -> None:
        """Prepare the limits of every pixel.

        Args:
            model: the empty scene.
            threshold: standard deviations from which on a difference counts.
            min_contrast: smallest difference that counts, grey levels.
            edge: fraction of the highest score nearby that the outline is put at.
            follow: allow for a white balance that has changed.
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
        self._grid = (slice(None), slice(step // 2, None, step), slice(step // 2, None, step))
        self._known = self._mean[self._grid]
        self._scratch = tuple(np.empty(model.mean.shape[1:], np.float32) for _ in range(2))

    def __call__(self, image: ImageArray) -> FloatImage:
        """Return a margin (H, W) for a bgr image (H, W, 3): not negative where it is foreground."""
        height, width = image.shape[:2]
        score, highest = self._scratch
        planes = chroma_planes(image)
        cast = self._cast(planes) if self._follow else (np.float32(0), np.float32(0))
        _score(planes, self._mean, self._brightest, self._weights, cast, score)
        cv2.dilate(score, _WINDOW, dst=highest)
        _margin(score, highest, self._edge)
        return np.asarray(cv2.resize(score, (width, height)), np.float32)

    def _cast(self, planes: ImageArray) -> tuple[np.float32, np.float32]:
        """Cr and Cb that the white balance has added, as shares of the brightness.

        Medians over the image: the person covers less than half of it.
        """
        now = planes[self._grid].astype(np.float32)
        brightness = np.maximum(now[0], _DARKEST)
        ratio = now[0] / np.maximum(self._known[0], _DARKEST)
        added = now[1:] - _NEUTRAL - ratio * (self._known[1:] - _NEUTRAL)
        shares = (added / brightness).reshape(2, -1)
        middle = shares.shape[1] // 2
        shares = np.partition(shares, middle, axis=1)[:, middle]
        red, blue = np.clip(shares, -_STRONGEST_CAST, _STRONGEST_CAST).astype(np.float32)
        return red, blue


@njit(cache=True, nogil=True, error_model="numpy")
def _score(planes: Any, mean: Any, brightest: Any, weights: Any, cast: Any, score: Any) -> None:
    """Distance of each pixel's chroma from the background's, in units of its limit."""
    neutral = np.float32(_NEUTRAL)
    darkest = np.float32(_DARKEST)
    lowest, highest = np.float32(_RATIOS[0]), np.float32(_RATIOS[1])
    cut_off, zero = np.float32(_CUT_OFF), np.float32(0)
    height, width = score.shape
    for v in range(height):
        for u in range(width):
            ratio = np.float32(planes[0, v, u]) / max(mean[0, v, u], darkest)
            ratio = min(max(ratio, lowest), highest)
            red = np.float32(planes[1, v, u]) - neutral - ratio * (mean[1, v, u] - neutral)
            blue = np.float32(planes[2, v, u]) - neutral - ratio * (mean[2, v, u] - neutral)
            red -= cast[0] * np.float32(planes[0, v, u])
            blue -= cast[1] * np.float32(planes[0, v, u])
            red *= weights[0, v, u]
            blue *= weights[1, v, u]
            distance = np.sqrt(red * red + blue * blue)
            score[v, u] = distance if ratio * brightest[v, u] < cut_off else zero


@njit(cache=True, nogil=True)
def _margin(score: Any, highest: Any, edge: Any) -> None:
    """Turn the score into how far it is above 1 and above its part of the highest nearby."""
    one = np.float32(1)
    height, width = score.shape
    for v in range(height):
        for u in range(width):
            value = score[v, u]
            score[v, u] = min(value - one, value - edge * highest[v, u])
