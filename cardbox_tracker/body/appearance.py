"""What a person's parts look like: one histogram of colours, or of grey values, for each part.

Colours are counted in ``COLOR_STEPS`` equal steps a channel, grey values in ``GREY_STEPS``. The
probabilities are kept as logarithms of one byte each, 1/255 of the way from that of a colour never
seen to 1, and travel as text in the body model: a few kB, for most colours are never seen.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import BodyModelError

PARTS = ("hand", "forearm", "torso", "head", "legs")
HAND, FOREARM, TORSO, HEAD, LEGS = range(len(PARTS))

COLOR_STEPS, GREY_STEPS = 12, 32
UNSEEN = 0.1
"""Share of a histogram that is spread evenly over all colours, so that one that was never seen
speaks neither for nor against a part."""

_LARGEST = 255
# Brightness is kept in steps of this many grey levels; a median of whole numbers fits exactly.
_BRIGHTNESS_STEP = 1 / 256
_CHANNELS = (1, 3)


def bins_of(channels: int) -> int:
    """Return how many bins a histogram of images with 1 or 3 channels has."""
    return GREY_STEPS if channels == 1 else COLOR_STEPS**3


def steps_of_levels(brightness: FloatArray, learned: FloatArray) -> NDArray[np.int32]:
    """Return which step each level 0 to 255 of each channel falls into, (channels, 256).

    Args:
        brightness: of the torso in the image, (channels,).
        learned: of the torso when the colours were learned, (channels,): levels are scaled so that
            the image is as bright.
    """
    steps = GREY_STEPS if len(learned) == 1 else COLOR_STEPS
    gains = learned / np.maximum(brightness, 1.0)
    scaled = np.arange(256) * gains[:, None] * steps / 256
    return np.minimum(scaled, steps - 1).astype(np.int32)


@dataclass(frozen=True, eq=False, repr=False)
class Appearance:
    """The colours of one person's parts in one light.

    Attributes:
        levels: of each part of ``PARTS`` and each bin, (5, bins), uint8, see the module; the bin of
            a colour is its step in the first channel, then the second and the third.
        brightness: median of each channel over the torso, (channels,), 1 for grey images, 3 for
            bgr; grey levels.

    Raises:
        BodyModelError: the shapes do not fit.
    """

    levels: NDArray[np.uint8]
    brightness: FloatArray

    def __post_init__(self) -> None:
        """Check the shapes and freeze copies of the arrays."""
        levels, brightness = np.array(self.levels), np.array(self.brightness, dtype=np.float64)
        channels = len(brightness) if brightness.ndim == 1 else 0
        shape = (len(PARTS), bins_of(channels))
        if channels not in _CHANNELS or levels.shape != shape or levels.dtype != np.uint8:
            raise BodyModelError(
                f"appearance has {levels.shape} levels and {brightness.shape} brightnesses; "
                f"expected {len(PARTS)} parts of {bins_of(1)} grey values or {bins_of(3)} colours"
            )
        brightness = np.round(np.clip(brightness, 0.0, 255.0) / _BRIGHTNESS_STEP) * _BRIGHTNESS_STEP
        for name, values in (("levels", levels), ("brightness", brightness)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def of(cls, histograms: FloatArray, brightness: FloatArray) -> Appearance:
        """Return the appearance of probabilities (5, bins), each row summing to one.

        Raises:
            BodyModelError: the shapes do not fit.
        """
        least = UNSEEN / histograms.shape[1]
        way = 1.0 - np.log(np.clip(histograms, least, 1.0)) / np.log(least)
        return cls(np.round(_LARGEST * way).astype(np.uint8), brightness)

    @property
    def is_grey(self) -> bool:
        """True if it was learned from images without colour."""
        return len(self.brightness) == 1

    @property
    def histograms(self) -> FloatArray:
        """Probability of each bin for each part, (5, bins)."""
        least = UNSEEN / self.levels.shape[1]
        histograms: FloatArray = least ** (1.0 - self.levels / _LARGEST)
        return histograms

    def __eq__(self, other: object) -> bool:
        """Two appearances are equal when every number is."""
        if not isinstance(other, Appearance):
            return NotImplemented
        return self._bytes() == other._bytes()

    def __hash__(self) -> int:
        """Hash of every number, in step with equality."""
        return hash(self._bytes())

    def __repr__(self) -> str:
        """Return a short text; the numbers say nothing to a reader."""
        return f"Appearance({'grey' if self.is_grey else 'colour'})"

    def _bytes(self) -> bytes:
        """Channels, brightness in steps, levels."""
        brightness = np.round(self.brightness / _BRIGHTNESS_STEP).astype("<u2")
        return bytes([len(brightness)]) + brightness.tobytes() + self.levels.tobytes()

    def to_text(self) -> str:
        """Return it as base64 of compressed bytes."""
        return base64.b64encode(zlib.compress(self._bytes(), 9)).decode("ascii")

    @classmethod
    def from_text(cls, text: str) -> Appearance:
        """Read what :meth:`to_text` wrote; blanks and line ends do not matter.

        Raises:
            BodyModelError: it is damaged.
        """
        most = 1 + 2 * max(_CHANNELS) + len(PARTS) * bins_of(max(_CHANNELS))
        try:
            packed = base64.b64decode("".join(text.split()), validate=True)
            # One byte more than fits, so that whatever is too long is seen, but not all of it made.
            raw = zlib.decompressobj().decompress(packed, most + 1)
        except (binascii.Error, zlib.error, ValueError):
            raw = b""
        channels = raw[0] if raw else 0
        begin = 1 + 2 * channels
        if channels not in _CHANNELS or len(raw) != begin + len(PARTS) * bins_of(channels):
            raise BodyModelError(
                "appearance is damaged: expected the base64 text that the initialization wrote; "
                "remove the key to track without colours, or initialize again"
            )
        brightness = np.frombuffer(raw[1:begin], "<u2") * _BRIGHTNESS_STEP
        return cls(np.frombuffer(raw[begin:], np.uint8).reshape(len(PARTS), -1), brightness)
