"""Averaging background model and foreground segmentation (paper, section II-B, equation (1)).

The mean I_B and the standard deviation sigma_B of each pixel's brightness are learned from images
of the empty scene. A pixel of a later image I_t is foreground where

    |I_B - I_t| >= threshold * sigma_B

with a threshold of 2. A pixel that happened to be free of noise while learning has a sigma near 0
and would fire on a single grey level, so sigma_B has a floor. The rule alone flags one noisy pixel
in twenty; the clean-up that follows is what makes a silhouette of it, and can be turned off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.foreground import segment_foreground
from cardbox_tracker.vision.regions import remove_small_regions

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

_KERNEL = np.ones((3, 3), np.uint8)
_GRID_PX = 1000


@dataclass(frozen=True)
class BackgroundConfig:
    """How the scene is learned and how a silhouette is cut out of it.

    Attributes:
        learn_images: images of the empty scene to average.
        threshold: foreground from this many standard deviations on, equation (1).
        min_stddev: floor of the standard deviation, grey levels.
        clean_up: False leaves the plain rule of equation (1), without all that follows.
        smoothing_px: standard deviation of the Gaussian that averages the difference before the
            threshold, px; it lowers the noise and with it the specks.
        min_contrast: a smoothed difference below this many grey levels is never foreground.
        shadow: a place darker by less than this fraction is a shadow, not the person; 0 is off.
        edge: a pixel next to one that differs much more is foreground only if it differs by this
            fraction of it, since smoothing spreads a strong contrast beyond the outline; 0 is off.
        flicker: follow brightness changes of the whole scene by this fraction at most; 0 is off.
        min_area: specks smaller than this fraction of the image are dropped.
        max_hole: holes smaller than this fraction of the image are filled.
    """

    learn_images: int = 30
    threshold: float = 2.0
    min_stddev: float = 1.5
    clean_up: bool = True
    smoothing_px: float = 0.6
    min_contrast: float = 7.0
    shadow: float = 0.13
    edge: float = 0.35
    flicker: float = 0.1
    min_area: float = 0.004
    max_hole: float = 0.0008


@dataclass(frozen=True)
class BackgroundModel:
    """Mean and standard deviation of the empty scene's brightness, each (H, W) float32."""

    mean: FloatImage
    stddev: FloatImage


class BackgroundLearner:
    """Averages images of the empty scene, one at a time (Welford's algorithm)."""

    def __init__(self) -> None:
        """Start with nothing learned."""
        self.count = 0
        self._mean: FloatImage | None = None
        self._squares: FloatImage | None = None

    def add(self, brightness: NDArray[np.uint8] | FloatImage) -> None:
        """Learn from one image (H, W).

        Raises:
            ValueError: its size differs from that of the images before it.
        """
        image = np.asarray(brightness, dtype=np.float32)
        if self._mean is None or self._squares is None:
            self._mean = np.zeros_like(image)
            self._squares = np.zeros_like(image)
        if image.shape != self._mean.shape:
            raise ValueError(f"image has shape {image.shape}, those before it {self._mean.shape}")
        self.count += 1
        delta = image - self._mean
        self._mean += delta / self.count
        self._squares += delta * (image - self._mean)

    def model(self) -> BackgroundModel:
        """Return what was learned.

        Raises:
            ValueError: fewer than two images were added.
        """
        if self._mean is None or self._squares is None or self.count < 2:
            raise ValueError(f"{self.count} images learned; a deviation needs two or more")
        stddev = np.sqrt(self._squares / (self.count - 1))
        return BackgroundModel(self._mean.copy(), stddev.astype(np.float32))


class SilhouetteExtractor:
    """Cuts the person out of images before one learned background."""

    def __init__(self, model: BackgroundModel, config: BackgroundConfig | None = None) -> None:
        """Prepare the thresholds of every pixel."""
        self.config = config = config or BackgroundConfig()
        self.model = model
        self.gain = 1.0
        self._limit = config.threshold * np.maximum(model.stddev, config.min_stddev)
        # With these, a difference of either sign becomes a score that reaches 1 at its limit.
        brighter = np.maximum(self._limit, config.min_contrast)
        darker = np.maximum(brighter, config.shadow * model.mean)
        self._brighter = np.asarray(1.0 / brighter, dtype=np.float32)
        self._darker = np.asarray(-1.0 / darker, dtype=np.float32)
        # A thousand pixels are enough for the one number that describes the scene's brightness.
        step = max(1, math.isqrt(model.mean.size // _GRID_PX))
        self._grid = (slice(None, None, step), slice(None, None, step))
        self._grid_mean = np.maximum(model.mean[self._grid], 1.0)
        # Fresh memory costs more than the arithmetic on it.
        self._scratch = tuple(np.empty_like(model.mean) for _ in range(2))

    def __call__(self, brightness: ImageArray) -> ImageArray:
        """Return the silhouette (H, W) of ``brightness`` (H, W): 255 for the person, else 0.

        Raises:
            ValueError: the image's size is not the background's.
        """
        if brightness.shape != self.model.mean.shape:
            raise ValueError(
                f"image has shape {brightness.shape}, the background {self.model.mean.shape}"
            )
        config = self.config
        if not config.clean_up:
            difference = np.abs(brightness - self.model.mean)
            return np.where(difference < self._limit, 0, 255).astype(np.uint8)
        self.gain = self._scene_gain(brightness)
        signed, score = self._scratch
        cv2.addWeighted(
            brightness, 1.0, self.model.mean, -self.gain, 0.0, dst=signed, dtype=cv2.CV_32F
        )
        if config.smoothing_px > 0:
            cv2.GaussianBlur(signed, (0, 0), config.smoothing_px, dst=signed)
        foreground = segment_foreground(signed, self._brighter, self._darker, config.edge, score)
        return clean_silhouette(foreground, config.min_area, config.max_hole)

    def _scene_gain(self, brightness: ImageArray) -> float:
        """How much brighter the whole scene is now: the person covers less than half of it."""
        if self.config.flicker <= 0:
            return 1.0
        ratios = (brightness[self._grid] / self._grid_mean).ravel()
        middle = len(ratios) // 2
        ratio = float(np.partition(ratios, middle)[middle])  # the median, without its checks
        if abs(ratio - 1.0) > self.config.flicker:
            return 1.0
        return ratio


def warm_up() -> None:
    """Cut one silhouette, so that no live image waits for the compiler."""
    model = BackgroundModel(np.zeros((8, 8), np.float32), np.ones((8, 8), np.float32))
    SilhouetteExtractor(model)(np.zeros((8, 8), np.uint8))


def clean_silhouette(foreground: ImageArray, min_area: float, max_hole: float) -> ImageArray:
    """Drop small specks and fill small holes of a binary image.

    Args:
        foreground: (H, W), 0 or 255.
        min_area: smallest speck to keep, as a fraction of the image.
        max_hole: largest hole to fill, as a fraction of the image.

    Returns:
        A new (H, W) image, 0 or 255.
    """
    # Closing, not opening: it joins what noise cut, and thin fingers survive it.
    closed = np.ascontiguousarray(cv2.morphologyEx(foreground, cv2.MORPH_CLOSE, _KERNEL), np.uint8)
    remove_small_regions(closed, 255, min_area * foreground.size)
    remove_small_regions(closed, 0, max_hole * foreground.size)
    return closed
