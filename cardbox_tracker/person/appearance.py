"""Appearance of a person: one histogram of colours or grey values for each part.

Colours are counted in ``COLOR_STEPS`` equal steps a channel, grey values in ``GREY_STEPS``. Each
probability is stored as one byte: its logarithm, scaled so that 0 is the probability of a colour
never seen and 255 is 1. The bytes are compressed to a text of a few kB in the body model, since
most colours are never seen.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import BodyModelError
from cardbox_tracker.person.sizes import FloatArray

PARTS = ("hand", "forearm", "torso", "head", "legs")
HAND, FOREARM, TORSO, HEAD, LEGS = range(len(PARTS))

COLOR_STEPS, GREY_STEPS = 12, 32
UNSEEN = 0.1
"""Share of a histogram that is spread evenly over all colours, so that a colour never seen
is neutral evidence."""

_LARGEST = 255
# Brightness is stored in steps of this many grey levels, which are exact for medians of integers.
_BRIGHTNESS_STEP = 1 / 256
_CHANNELS = (1, 3)


def bins_of(channels: int) -> int:
    """Return the number of bins of a histogram of images with 1 or 3 channels."""
    return GREY_STEPS if channels == 1 else COLOR_STEPS**3


def steps_of_levels(brightness: FloatArray, learned: FloatArray) -> NDArray[np.int32]:
    """Return the step of each level 0 to 255 in each channel, (channels, 256).

    Levels are scaled by the ratio of the torso's brightness in the image and when it was learned.
    """
    steps = GREY_STEPS if len(learned) == 1 else COLOR_STEPS
    gains = learned / np.maximum(brightness, 1.0)
    scaled = np.arange(256) * gains[:, None] * steps / 256
    return np.minimum(scaled, steps - 1).astype(np.int32)


@dataclass(frozen=True, eq=False, repr=False)
class Appearance:
    """The colours of one person's parts in one light.

    Raises BodyModelError if the shapes do not fit.
    """

    #: stored probability of each part of ``PARTS`` and each bin, (5, bins), uint8, see the module;
    #: bins are ordered by the step in the first channel, then the second and the third
    levels: NDArray[np.uint8]
    #: median of each channel over the torso, (channels,), 1 for grey images, 3 for bgr; grey levels
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
        """Return the appearance of probabilities (5, bins), each row summing to one."""
        least = UNSEEN / histograms.shape[1]
        way = 1.0 - np.log(np.clip(histograms, least, 1.0)) / np.log(least)
        return cls(np.round(_LARGEST * way).astype(np.uint8), brightness)

    @property
    def is_grey(self) -> bool:
        """Whether it was learned from grey images."""
        return len(self.brightness) == 1

    @property
    def histograms(self) -> FloatArray:
        """Probability of each bin for each part, (5, bins)."""
        least = UNSEEN / self.levels.shape[1]
        histograms: FloatArray = least ** (1.0 - self.levels / _LARGEST)
        return histograms

    def __eq__(self, other: object) -> bool:
        """Return whether all numbers are equal."""
        if not isinstance(other, Appearance):
            return NotImplemented
        return self._bytes() == other._bytes()

    def __hash__(self) -> int:
        """Return a hash of all numbers."""
        return hash(self._bytes())

    def __repr__(self) -> str:
        """Return a short text without the numbers."""
        return f"Appearance({'grey' if self.is_grey else 'colour'})"

    def _bytes(self) -> bytes:
        """Return the number of channels, the brightness in steps, and the levels."""
        brightness = np.round(self.brightness / _BRIGHTNESS_STEP).astype("<u2")
        return bytes([len(brightness)]) + brightness.tobytes() + self.levels.tobytes()

    def to_text(self) -> str:
        """Return a base64 text of the compressed bytes."""
        return base64.b64encode(zlib.compress(self._bytes(), 9)).decode("ascii")

    @classmethod
    def from_text(cls, text: str) -> Appearance:
        """Parse the text of :meth:`to_text`; raise BodyModelError if it is damaged."""
        most = 1 + 2 * max(_CHANNELS) + len(PARTS) * bins_of(max(_CHANNELS))
        try:
            packed = base64.b64decode("".join(text.split()), validate=True)
            # One byte more than the limit shows that a text is too long without unpacking all of
            # it.
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
