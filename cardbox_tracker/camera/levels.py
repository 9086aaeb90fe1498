"""Scales images of 16 bits to eight by the range that a camera uses.

Infrared and thermal cameras use 10 to 14 of the 16 bits, or a small part in the middle. All images
of a camera get the same scale, because a background is compared with them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# The darkest and brightest pixels of an image, which may be faulty, do not count.
_FAULTY = 0.001
# The scale changes if more of an image lies outside of the range; a person covers less.
_MOST_OUTSIDE = 0.25
# A camera whose first image would have fewer of 256 levels measures temperatures.
_FEW = 10
_EVERY = 4
_ALL = 1 << 16


class Levels:
    """Scale of the images of one camera.

    Attributes:
        text: the scale in words; empty before the first image, and if all 16 bits are used.
        changes: how often the scale was set, which a large change of the brightness does again.
    """

    def __init__(self) -> None:
        """Begin without a scale."""
        self.text, self.changes = "", 0
        self._low, self._width = 0, 0

    def __call__(self, image: NDArray[Any]) -> NDArray[np.uint8]:
        """Return an image uint16 as uint8 of the same shape."""
        sample = image[::_EVERY, ::_EVERY]
        outside = (sample < self._low) | (sample >= self._low + self._width)
        if np.mean(outside) > _MOST_OUTSIDE:
            self._set(image)
        shift = self._width.bit_length() - 9
        if self._width == _ALL:
            return (image >> shift).astype(np.uint8)
        inside = np.clip(image.astype(np.int32) - self._low, 0, self._width - 1)
        return (inside >> shift).astype(np.uint8)

    def _set(self, image: NDArray[Any]) -> None:
        low, high = (int(value) for value in np.quantile(image, (_FAULTY, 1 - _FAULTY)))
        self._low, self._width = 0, max(256, 1 << high.bit_length())
        narrow = max(256, 1 << (2 * (high - low)).bit_length())
        # A plain wall has few levels, too, and people before it need those below and above.
        if 256 * (high - low) < _FEW * self._width and narrow < self._width:
            self._low, self._width = max(0, (low + high - narrow) // 2), narrow
        self.changes += 1
        last = self._low + self._width - 1
        self.text = (
            f"images of 16 bits have values from {low} to {high}; {self._low} to {last} are scaled "
            "to 0 to 255"
            if self._width < _ALL
            else ""
        )
