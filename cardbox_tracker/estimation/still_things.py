"""Appearance of objects at rest in front of the background, such as an open door.

A hand in front of such an object lies in the object's region, but differs from it in colour.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import copied_kernel, kernel
from cardbox_tracker.vision.array_checks import check_array

ImageArray = NDArray[np.uint8]

# Change of a channel, in grey levels, beyond which a pixel shows something else.
_CHANGE = 18
# Images until a constant pixel is known (0.5 s at 15 Hz), and until a covered one is forgotten
# (10 s at 15 Hz).
_KNOWN, _LONGEST = 8, 150

BACKGROUND, PERSON, THING = 0, 1, 2
"""Class of a pixel by the silhouette."""
UNKNOWN, SAME, CHANGED = 0, 1, 2
"""Result of the comparison of a pixel with the object at rest."""


class StillThings:
    """The pixels of objects at rest that are not the person."""

    def __init__(self) -> None:
        """Begin without known objects."""
        self._looks: ImageArray | None = None
        self._counts = np.zeros((0, 0), np.int16)

    def forget(self) -> None:
        """Forget all objects."""
        self._looks = None

    def compare(self, image: ImageArray) -> NDArray[np.uint8]:
        """Return ``UNKNOWN``, ``SAME`` or ``CHANGED`` for each pixel of an image (H, W[, 3])."""
        found = np.zeros(image.shape[:2], np.uint8)
        planes = _planes(image)
        if self._looks is not None and self._looks.shape == planes.shape:
            _compare(planes, self._looks, self._counts, found)
        return found

    def learn(self, image: ImageArray, shows: NDArray[np.uint8]) -> None:
        """Update from an image, of which ``shows`` (H, W) has the class of each pixel."""
        planes = _planes(image)
        check_array("shows", shows, planes.shape[:2])
        if self._looks is None or self._looks.shape != planes.shape:
            self._looks = np.zeros_like(planes)
            self._counts = np.zeros(planes.shape[:2], np.int16)
        _learn(planes, shows, self._looks, self._counts)


def _planes(image: ImageArray) -> ImageArray:
    """Return an image (H, W) or (H, W, 3) as (H, W, channels), copied if it is read-only."""
    # numba would compile another version for read-only arrays.
    pixels = np.require(image, requirements=("C", "W"))
    return pixels[..., None] if pixels.ndim == 2 else pixels


@copied_kernel
def _change(image: Any, looks: Any, v: Any, u: Any) -> Any:
    """Return the largest difference over the channels of a pixel."""
    largest: Any = 0
    for k in range(looks.shape[2]):
        largest = max(largest, abs(np.int32(image[v, u, k]) - np.int32(looks[v, u, k])))
    return largest


@kernel
def _compare(image: Any, looks: Any, counts: Any, found: Any) -> None:
    height, width = counts.shape
    for v in range(height):
        for u in range(width):
            if counts[v, u] >= _KNOWN:
                found[v, u] = CHANGED if _change(image, looks, v, u) > _CHANGE else SAME


@kernel
def _learn(image: Any, shows: Any, looks: Any, counts: Any) -> None:
    height, width = counts.shape
    for v in range(height):
        for u in range(width):
            count = counts[v, u]
            if shows[v, u] != THING:
                if count != 0:
                    counts[v, u] = 0
                continue
            if count > 0 and _change(image, looks, v, u) <= _CHANGE:
                counts[v, u] = min(count + 1, _LONGEST)
                # Slow changes of the light are followed.
                for k in range(looks.shape[2]):
                    now, before = image[v, u, k], looks[v, u, k]
                    looks[v, u, k] = before + np.uint8(now > before) - np.uint8(now < before)
            elif count > _KNOWN:
                # The object is covered.
                counts[v, u] = count - 1
            else:
                counts[v, u] = 1
                for k in range(looks.shape[2]):
                    looks[v, u, k] = image[v, u, k]
