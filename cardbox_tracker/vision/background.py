"""Averaging background model and foreground segmentation (paper, section II-B, equation (1)).

The mean I_B and the standard deviation sigma_B of each pixel's brightness are learned from images
of the empty scene. A pixel of a later image I_t is foreground where

    |I_B - I_t| >= threshold * sigma_B

with a threshold of 2. A pixel that happened to be free of noise while learning has a sigma near 0
and would fire on a single grey level, so sigma_B has a floor. The rule alone flags one noisy pixel
in twenty; a clean-up follows, which can be turned off. Images in colour add a comparison of their
chroma, and soft shadows are told from dark clothes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.settings import check, setting
from cardbox_tracker.vision.chroma import ChromaScore
from cardbox_tracker.vision.empty_scene import BackgroundLearner, BackgroundModel, brightness_of
from cardbox_tracker.vision.foreground import segment_foreground
from cardbox_tracker.vision.light import LightFollower
from cardbox_tracker.vision.regions import clean_silhouette
from cardbox_tracker.vision.shadows import decide_shadows
from cardbox_tracker.vision.window import Window, window_of

__all__ = [
    "BackgroundConfig",
    "BackgroundLearner",
    "BackgroundModel",
    "SilhouetteExtractor",
    "brightness_of",
    "clean_silhouette",
    "warm_up",
]

ImageArray = NDArray[np.uint8]

# Pixels whose median says how bright the scene is: its error is about 4 % of their spread.
_BRIGHTNESS_SAMPLES = 1000
# Around foreground, so that all around it is background, and for a hand that only its colour shows.
_MARGIN_PX, _COLOR_MARGIN_PX = 2, 8
# Images from one that is compared by colour everywhere to the next.
_WHOLE_EVERY = 8
# A fraction of a darker brightness than this is all noise, grey levels.
_DARKEST = 8.0


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
    soft_shadow: float = setting(
        0.07,
        "a darker pixel is also a shadow where the brightness relative to the background changes "
        "by less than this fraction within 5x5 px, all the way from the background; 0 is off",
        limits=(0.0, 1.0),
    )
    darkest_shadow: float = setting(
        0.4,
        "a pixel that is darker than the background by more than this fraction is no soft shadow",
        limits=(0.0, 1.0),
    )
    color: bool = setting(
        True,
        "a pixel is also foreground if its colour differs; only for images in colour",
    )
    min_color_contrast: float = setting(
        7.0,
        "a colour difference (Cr, Cb) below this is never foreground",
        unit="grey levels",
        limits=(0.1, 255.0),
    )
    color_edge: float = setting(
        0.45,
        "a colour difference is dropped if it is less than this fraction of the largest within "
        "6 px, because JPEG smears colours over an outline",
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
        "with follow off: a brightness change of the whole scene up to this fraction is "
        "compensated; 0 is off",
        limits=(0.0, 1.0),
    )
    follow: bool = setting(
        True,
        "follow the light of the scene: drift, automatic gain and white balance, a lamp; the "
        "person never becomes background",
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
        # As far as three standard deviations; OpenCV's own choice is wider and takes longer.
        size = 2 * math.ceil(3 * config.smoothing_px) + 1
        self._kernel_size = (size, size)
        self._chroma: ChromaScore | None = None
        if model.chroma is not None and config.color:
            self._chroma = ChromaScore(
                model.chroma,
                config.threshold,
                config.min_color_contrast,
                config.color_edge,
                config.follow,
            )
        self._light: LightFollower | None = None
        if config.follow and config.clean_up:
            chroma = None if model.chroma is None else model.chroma.mean
            self._light = LightFollower(model.mean, chroma)
        self._per_level = np.asarray(1.0 / np.maximum(model.mean, _DARKEST), np.float32)
        # The last silhouette's, and how many images were compared by colour.
        self._last, self._images = Window(0, 0, 0, 0), 0
        # Allocated once: new memory for each image takes longer than the arithmetic on it.
        self._scratch = tuple(np.empty_like(model.mean) for _ in range(2))

    def __call__(self, image: ImageArray) -> ImageArray:
        """Return the silhouette (H, W) of an image: 255 for the person, else 0.

        Args:
            image: brightness (H, W), or bgr (H, W, 3).

        Raises:
            ValueError: the image's size is not the background's.
        """
        brightness = brightness_of(image)
        if brightness.shape != self.model.mean.shape:
            raise ValueError(
                f"image has shape {brightness.shape}, the background {self.model.mean.shape}"
            )
        config = self.config
        if not config.clean_up:
            difference = np.abs(brightness - self.model.mean)
            return np.where(difference < self._limit, 0, 255).astype(np.uint8)
        signed, score = self._scratch
        if self._light is None:
            self.gain = self._scene_gain(brightness)
            expected, shares = self.model.mean, (1.0, -self.gain)
        else:
            expected, factor = self._light.follow(brightness)
            self.gain = self._light.level
            # In more light contrasts are larger, too: the limits are those of the learned light.
            shares = 1.0 / max(self.gain, 1.0), -factor / max(self.gain, 1.0)
        cv2.addWeighted(
            brightness, shares[0], expected, shares[1], 0.0, dst=signed, dtype=cv2.CV_32F
        )
        if config.smoothing_px > 0:
            cv2.GaussianBlur(signed, self._kernel_size, config.smoothing_px, dst=signed)
        foreground = segment_foreground(signed, self._brighter, self._darker, config.edge, score)
        window = window_of(foreground)
        colored = None
        if self._chroma is not None and image.ndim == 3:
            window, looked_at = self._colored_window(window, foreground.shape)
            colored = self._chroma(image, looked_at)
        else:
            window = window.grown(_MARGIN_PX, foreground.shape)
        if config.soft_shadow > 0:
            decide_shadows(
                foreground,
                signed,
                self._per_level,
                colored,
                config.darkest_shadow,
                config.soft_shadow,
                window,
            )
        elif colored is not None:
            foreground[window.slices][colored >= 0] = 255
        silhouette = clean_silhouette(foreground, config.min_area, config.max_hole, window)
        self._last = window_of(silhouette)
        if self._light is not None:
            self._light.exclude(silhouette)
        return silhouette

    def _colored_window(
        self, window: Window, shape: tuple[int, ...]
    ) -> tuple[Window, Window | None]:
        """Return where foreground can be, and where to look for its colour; None: everywhere.

        Args:
            window: of the foreground by brightness.
            shape: of the image.
        """
        number, self._images = self._images, self._images + 1
        is_settling = self._light is not None and self._light.is_settling
        everywhere = Window(0, shape[0], 0, shape[1])
        near = window.joined(self._last).grown(_COLOR_MARGIN_PX, shape)
        is_odd = any(length % 2 for length in shape)
        if number % _WHOLE_EVERY == 0 or is_settling or is_odd or near.is_empty:
            return everywhere, None
        return near, near

    def restart(self) -> None:
        """Forget what was followed: the next image is not the one after the last."""
        self._last, self._images = Window(0, 0, 0, 0), 0
        if self._light is not None:
            self._light.restart()

    def expect_other_light(self) -> None:
        """Say that the next image may be in another light than what was learned."""
        if self._light is not None:
            self._light.expect_step()

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
    learner = BackgroundLearner()
    for _ in range(2):
        learner.add(np.full((16, 16, 3), 90, np.uint8))
    extractor = SilhouetteExtractor(learner.model())
    extractor(np.zeros((16, 16), np.uint8))
    extractor(np.zeros((16, 16, 3), np.uint8))
