"""Learns the mean and standard deviation of each pixel from images of the empty scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.camera.given_arrays import image_from
from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.segmentation.chroma import ChromaModel, chroma_planes, half_size

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]


@dataclass(frozen=True)
class BackgroundModel:
    """Mean and standard deviation of the empty scene's brightness, each (H, W) float32.

    Raises ValueError if an array has another shape or type.
    """

    mean: FloatImage  #: mean brightness
    stddev: FloatImage  #: standard deviation of the brightness
    #: mean and standard deviation of the colours; None if the images were grey
    chroma: ChromaModel | None = None

    def __post_init__(self) -> None:
        check_array("mean", self.mean, (ANY, ANY), np.float32)
        check_array("stddev", self.stddev, self.mean.shape, np.float32)
        if self.chroma is not None:
            shape = (3, *half_size(self.mean))
            check_array("mean of chroma", self.chroma.mean, shape, np.float32)
            check_array("stddev of chroma", self.chroma.stddev, shape, np.float32)


class BackgroundLearner:
    """Averages images of the empty scene, one at a time."""

    def __init__(self) -> None:
        self._brightness = _Moments()
        self._chroma = _Moments()

    @property
    def count(self) -> int:
        """Number of images learned so far."""
        return self._brightness.count

    def add(self, image: NDArray[np.uint8] | FloatImage) -> None:
        """Learn from brightness (H, W) or bgr (H, W, 3), or raise ValueError."""
        image = image_from(image)
        self._brightness.add(brightness_of(image) if image.ndim == 3 else image)
        # A single grey image makes the comparison by colour impossible.
        if image.ndim == 3 and self._chroma.count == self._brightness.count - 1:
            self._chroma.add(chroma_planes(image))

    def model(self) -> BackgroundModel:
        """Return the learned background; ValueError if fewer than two images were added."""
        mean, stddev = self._brightness.result()
        whole = self._chroma.count == self._brightness.count
        chroma = ChromaModel(*self._chroma.result()) if whole else None
        return BackgroundModel(mean, stddev, chroma)


class _Moments:
    """Mean and standard deviation of arrays of one shape (Welford's algorithm)."""

    def __init__(self) -> None:
        self.count = 0
        self._mean: FloatImage | None = None
        self._squares: FloatImage | None = None

    def add(self, values: NDArray[np.uint8] | FloatImage) -> None:
        image = np.asarray(values, dtype=np.float32)
        if self._mean is None or self._squares is None:
            self._mean = np.zeros_like(image)
            self._squares = np.zeros_like(image)
        if image.shape != self._mean.shape:
            raise ValueError(f"image has shape {image.shape}, those before it {self._mean.shape}")
        self.count += 1
        delta = image - self._mean
        self._mean += delta / self.count
        self._squares += delta * (image - self._mean)

    def result(self) -> tuple[FloatImage, FloatImage]:
        if self._mean is None or self._squares is None or self.count < 2:
            raise ValueError(f"{self.count} images learned; a deviation needs two or more")
        stddev = np.sqrt(self._squares / (self.count - 1))
        return self._mean.copy(), stddev.astype(np.float32)
