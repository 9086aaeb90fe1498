"""Averaging background model and foreground segmentation (paper, section II-B, equation (1)).

The mean I_B and the standard deviation sigma_B of each pixel's brightness are learned from images
of the empty scene. A pixel of a later image I_t is foreground where

    |I_B - I_t| >= threshold * sigma_B

with a threshold of 2. A pixel that happened to be free of noise while learning has a sigma near 0
and would fire on a single grey level, so sigma_B has a floor. The rule alone flags one noisy pixel
in twenty; a clean-up follows, which can be turned off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.settings import check, setting
from cardbox_tracker.vision.foreground import segment_foreground
from cardbox_tracker.vision.regions import remove_small_regions

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# The smallest kernel that closes a gap of one pixel, in all eight directions.
_CLOSING_KERNEL = np.ones((3, 3), np.uint8)
# Pixels whose median says how bright the scene is: its error is about 4 % of their spread.
_BRIGHTNESS_SAMPLES = 1000


@dataclass(frozen=True)
class BackgroundConfig:
    """How the scene is learned and how a silhouette is cut out of it."""

    learn_images: int = setting(30, "images of the empty scene to learn from", limits=(2, 10000))
    threshold: float = setting(
        2.0,
        "a pixel is foreground if it differs from the background by this many standard deviations "
        "or more, equation (1)",
        limits=(0.1, 50.0),
    )
    min_stddev: float = setting(
        1.5,
        "smallest standard deviation that is assumed of a pixel",
        unit="grey levels",
        limits=(0.0, 100.0),
    )
    clean_up: bool = setting(
        True, "false applies equation (1) alone: all settings after this one have no effect"
    )
    smoothing_px: float = setting(
        0.6,
        "standard deviation of the Gaussian that smooths the difference before the threshold; "
        "it lowers the noise and with it the specks",
        unit="px",
        limits=(0.0, 20.0),
    )
    min_contrast: float = setting(
        7.0,
        "a smoothed difference below this is never foreground",
        unit="grey levels",
        limits=(0.0, 255.0),
    )
    shadow: float = setting(
        0.13,
        "a pixel that is darker than the background by less than this fraction is a shadow, not "
        "the person; 0 is off",
        limits=(0.0, 1.0),
    )
    # Smoothing spreads a strong contrast beyond the outline.
    edge: float = setting(
        0.35,
        "a pixel is dropped if its difference is less than this fraction of the largest among its "
        "8 neighbours, so that smoothing does not widen the outline; 0 is off",
        limits=(0.0, 1.0),
    )
    flicker: float = setting(
        0.1,
        "a brightness change of the whole scene up to this fraction is compensated; 0 is off",
        limits=(0.0, 1.0),
    )
    min_area: float = setting(
        0.004,
        "foreground regions smaller than this fraction of the image are dropped",
        limits=(0.0, 1.0),
    )
    max_hole: float = setting(
        0.0008,
        "holes smaller than this fraction of the image are filled",
        limits=(0.0, 1.0),
    )

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a value is out of range; the text names it.
        """
        check(self)


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
        # Factors that turn a difference of either sign into a score, 1 at its limit.
        brighter = np.maximum(self._limit, config.min_contrast)
        darker = np.maximum(brighter, config.shadow * model.mean)
        self._brighter = np.asarray(1.0 / brighter, dtype=np.float32)
        self._darker = np.asarray(-1.0 / darker, dtype=np.float32)
        step = max(1, math.isqrt(model.mean.size // _BRIGHTNESS_SAMPLES))
        self._grid = (slice(None, None, step), slice(None, None, step))
        self._grid_mean = np.maximum(model.mean[self._grid], 1.0)
        # Allocated once: new memory for each image takes longer than the arithmetic on it.
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
    closed = np.ascontiguousarray(
        cv2.morphologyEx(foreground, cv2.MORPH_CLOSE, _CLOSING_KERNEL), np.uint8
    )
    remove_small_regions(closed, 255, min_area * foreground.size)
    remove_small_regions(closed, 0, max_hole * foreground.size)
    return closed
