"""Averaging background model and foreground segmentation (paper, section II-B, equation (1)).

The mean I_B and the standard deviation sigma_B of each pixel's brightness are learned from images
of the empty scene. A pixel of a later image I_t is foreground where

    |I_B - I_t| >= threshold * sigma_B

with a threshold of 2. A pixel that was free of noise while learning would have a sigma_B near 0 and
respond to a single grey level, so sigma_B has a lower bound. The rule alone marks one noisy pixel
in twenty as foreground; a clean-up, which can be turned off, removes those. Colour images are also
compared by chroma, and soft shadows are distinguished from dark clothes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.camera.given_arrays import image_from
from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.settings import settings_or
from cardbox_tracker.segmentation.absorption import Absorber
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.chroma import DARKEST, ChromaScore, colors_of
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.light import LEAST_LEVEL, LightFollower
from cardbox_tracker.segmentation.partial_scene import merged
from cardbox_tracker.segmentation.regions import LEAST_AREA, MOST_HOLE, SQUARE, clean_silhouette
from cardbox_tracker.segmentation.shadows import decide_shadows
from cardbox_tracker.segmentation.window import Window, window_of

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]


def segment_foreground(
    difference: FloatImage,
    brighter: FloatImage,
    darker: FloatImage,
    edge: float,
) -> tuple[ImageArray, Window]:
    """Mark the pixels whose score is at least 1 and at least ``edge`` times their neighbours'.

    The score of a difference, (H, W), grey levels, is the larger of its products with ``brighter``
    and ``darker``: scores of one grey level more than the background, and negative ones of one
    less, (H, W). ``edge`` is a fraction of the highest score among a pixel and its 8 neighbours.

    Returns (H, W), 0 or 255, and its window as :func:`~.window.window_of` has it. Raises ValueError
    if the arrays differ in shape or type, or have no pixels.
    """
    check_array("difference", difference, (ANY, ANY), np.float32)
    if not difference.size:
        raise ValueError(f"difference has the shape {difference.shape}; expected pixels")
    shape = difference.shape
    check_array("brighter", brighter, shape, np.float32)
    check_array("darker", darker, shape, np.float32)
    score = np.maximum(difference * brighter, difference * darker)
    highest = np.asarray(cv2.dilate(score, SQUARE), np.float32).reshape(shape)
    is_seen = (score >= np.float32(edge) * highest) & (score >= np.float32(1))
    foreground: ImageArray = np.uint8(255) * is_seen
    return foreground, window_of(foreground)


LEAST_STDDEV = 1.5
"""Least standard deviation of a pixel, grey levels."""
# Standard deviation of the Gaussian that smooths differences against noise, px. The kernel covers
# three of them; OpenCV's default is wider and slower.
_SMOOTHING_PX, _KERNEL_SIZE = 0.6, (5, 5)
# A pixel is dropped if its difference is less than this share of the largest among its neighbours,
# because smoothing spreads a strong contrast beyond the outline.
_EDGE = 0.35
# Least difference of colours (Cr, Cb), grey levels, and the share of the largest within 6 px below
# which it is dropped, because JPEG smears colours over an outline.
_LEAST_COLOR_CONTRAST, _COLOR_EDGE = 7.0, 0.45
# Largest darkening by a soft shadow, as a share of the background's brightness.
_DARKEST_SHADOW = 0.4
# Largest change of the brightness of the whole scene that is compensated if light is not followed.
_FLICKER = 0.1
# Number of pixels whose median estimates the brightness of the scene.
_BRIGHTNESS_SAMPLES = 1000
# Margin around the foreground, and around the part that is compared by colour.
_MARGIN_PX = 8
# One image in this many is compared by colour everywhere, not only near the foreground.
_WHOLE_EVERY = 8


class SilhouetteExtractor:
    """Cuts the person out of images before one learned background."""

    def __init__(self, model: BackgroundModel, config: BackgroundConfig | None = None) -> None:
        """Prepare the thresholds of every pixel."""
        self.config = config = settings_or(BackgroundConfig(), config)
        self.gain = 1.0
        step = max(1, math.isqrt(model.mean.size // _BRIGHTNESS_SAMPLES))
        self._grid = (slice(None, None, step), slice(None, None, step))
        self._light: LightFollower | None = None
        self._chroma: ChromaScore | None = None
        self._learned = model
        self._use(model)
        if config.follow and config.clean_up:
            chroma = None if model.chroma is None else model.chroma.mean
            self._light = LightFollower(model.mean, chroma)
        self._absorber = Absorber(config.absorb_after) if config.absorb_after else None
        # Window of the last silhouette, and number of images compared by colour.
        self._last, self._images = Window(0, 0, 0, 0), 0
        self._is_even = not any(length % 2 for length in model.mean.shape)
        self._signed = np.empty_like(model.mean)

    def _use(self, model: BackgroundModel) -> None:
        """Compare the next images with ``model``."""
        config = self.config
        self.model = model
        self._limit = config.threshold * np.maximum(model.stddev, LEAST_STDDEV)
        # Factors that turn a difference of either sign into a score, 1 at its limit.
        brighter = np.maximum(self._limit, config.min_contrast)
        darker = np.maximum(brighter, config.shadow * model.mean)
        self._brighter = np.asarray(1.0 / brighter, dtype=np.float32)
        self._darker = np.asarray(-1.0 / darker, dtype=np.float32)
        self._grid_mean = np.maximum(model.mean[self._grid], 1.0)
        self._per_level = np.asarray(1.0 / np.maximum(model.mean, DARKEST), np.float32)
        before, self._chroma = self._chroma, None
        if model.chroma is not None and config.color:
            self._chroma = ChromaScore(
                model.chroma,
                config.threshold,
                _LEAST_COLOR_CONTRAST,
                _COLOR_EDGE,
                config.follow,
                before,
            )
        if self._light is not None:
            self._light.replace(model.mean, None if model.chroma is None else model.chroma.mean)

    def _absorb(
        self, image: ImageArray, brightness: ImageArray, silhouette: ImageArray, stamp_ns: int
    ) -> None:
        """Add objects that were moved and stay to the background."""
        if self._absorber is None:
            return
        absorbed = self._absorber.add(image, brightness, silhouette, self.gain, stamp_ns)
        if absorbed is not None:
            pixels, now = absorbed
            if self._chroma is not None and now.chroma is not None:
                now = replace(now, chroma=self._chroma.without_cast(now.chroma))
            factors = np.full(pixels.shape, self.gain, np.float32)
            if self._light is not None:
                factors = self._light.factors()
            light = np.asarray(1.0 / np.maximum(factors, np.float32(LEAST_LEVEL)), np.float32)
            self._use(merged(self.model, now, pixels, light))

    def __call__(self, image: ImageArray, stamp_ns: int = 0) -> ImageArray:
        """Return the silhouette (H, W) of an image: 255 for the person, else 0.

        It is brightness (H, W), or bgr (H, W, 3); other types than uint8 are converted, see
        :func:`~cardbox_tracker.camera.given_arrays.image_from`. Its stamp, ns, is 0 if unknown.
        Raises ValueError if the size is not the background's, or type or values are impossible.
        """
        image = image_from(image)
        if image.shape[:2] != self.model.mean.shape:
            raise ValueError(
                f"image has shape {image.shape[:2]}, the background {self.model.mean.shape}"
            )
        has_color = self._chroma is not None and image.ndim == 3
        brightness = brightness_of(image)
        config = self.config
        if not config.clean_up:
            difference = np.abs(brightness - self.model.mean)
            return np.asarray(np.uint8(255) * ~(difference < self._limit))
        signed = self._signed
        if self._light is None:
            self.gain = self._scene_gain(brightness)
            expected, shares = self.model.mean, (1.0, -self.gain)
        else:
            expected, factor = self._light.follow(brightness)
            self.gain = self._light.level
            # More light increases contrasts, and the limits belong to the learned light.
            shares = 1.0 / max(self.gain, 1.0), -factor / max(self.gain, 1.0)
        cv2.addWeighted(
            brightness, shares[0], expected, shares[1], 0.0, dst=signed, dtype=cv2.CV_32F
        )
        cv2.GaussianBlur(signed, _KERNEL_SIZE, _SMOOTHING_PX, dst=signed)
        foreground, window = segment_foreground(signed, self._brighter, self._darker, _EDGE)
        near: Window | None = window.grown(_MARGIN_PX, foreground.shape)
        if has_color:
            near = self._near(window, foreground.shape)
        self._decide(foreground, near, colors_of(image) if has_color else None)
        window = near or window_of(foreground).grown(_MARGIN_PX, foreground.shape)
        silhouette, self._last = clean_silhouette(foreground, LEAST_AREA, MOST_HOLE, window)
        if self._light is not None:
            self._light.exclude(silhouette, self._last)
        self._absorb(image, brightness, silhouette, stamp_ns)
        return silhouette

    def _near(self, window: Window, shape: tuple[int, ...]) -> Window | None:
        """Return where to look for foreground by colour, near that by brightness; None: all."""
        number, self._images = self._images, self._images + 1
        is_settling = self._light is not None and self._light.is_settling
        if number % _WHOLE_EVERY == 0 or is_settling or not self._is_even:
            return None
        near = window.joined(self._last).grown(_MARGIN_PX, shape)
        return None if near.is_empty else near

    def _decide(
        self, foreground: ImageArray, window: Window | None, colors: ImageArray | None
    ) -> None:
        """Add coloured pixels in a window (None: everywhere), and remove soft shadows."""
        colored, softest = None, self.config.soft_shadow
        if colors is not None and self._chroma is not None:
            colored = self._chroma(colors, foreground.shape, window)
        if softest > 0:
            parts = foreground, self._signed, self._per_level, colored
            decide_shadows(*parts, _DARKEST_SHADOW, softest, window)
        elif colored is not None:
            part = ... if window is None else window.slices
            foreground[part] |= colored

    def restart(self) -> None:
        """Forget the light and the absorbed objects: the next image is not the successor."""
        self._last, self._images = Window(0, 0, 0, 0), 0
        if self._light is not None:
            self._light.restart()
        if self._absorber is not None:
            self._absorber.restart()
        if self.model is not self._learned:
            self._use(self._learned)

    def expect_other_light(self) -> None:
        """Expect that the light of the next image differs from that of the learned background."""
        if self._light is not None:
            self._light.expect_step()

    def _scene_gain(self, brightness: ImageArray) -> float:
        """Return the brightness relative to the background: a median, since the person is small."""
        ratios = (brightness[self._grid] / self._grid_mean).ravel()
        middle = len(ratios) // 2
        ratio = float(np.partition(ratios, middle)[middle])  # the median, without its checks
        if abs(ratio - 1.0) > _FLICKER:
            return 1.0
        return ratio


def warm_up() -> None:
    """Extract silhouettes, so that the kernels are compiled before the first live image."""
    learner = BackgroundLearner()
    color = np.full((16, 16, 3), 90, np.uint8)
    for _ in range(2):
        learner.add(color)
    extractor = SilhouetteExtractor(learner.model())
    color[4:12, 4:12] = 250
    grey = np.ascontiguousarray(color[..., 0])
    # Arrays over the memory of messages are read-only, which is another type to numba.
    for image in (grey, color):
        extractor(image)
        extractor(np.frombuffer(image.tobytes(), np.uint8).reshape(image.shape))
