"""Windows that contain the foreground of an image, so that the rest need not be processed."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array

ImageArray = NDArray[np.uint8]


class Window(NamedTuple):
    """Part of an image: rows ``top`` to ``bottom`` and columns ``left`` to ``right``, ends not."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Slices of rows and columns that index an array."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def is_empty(self) -> bool:
        """Whether the window has no pixels."""
        return self.bottom <= self.top or self.right <= self.left

    @property
    def area_px(self) -> int:
        """Number of its pixels."""
        return max(self.bottom - self.top, 0) * max(self.right - self.left, 0)

    def check_within(self, shape: tuple[int, ...], unit: int) -> None:
        """Raise ValueError unless it is in an image of ``shape`` and in steps of ``unit`` px."""
        top, bottom, left, right = self
        is_inside = 0 <= top <= bottom <= shape[0] and 0 <= left <= right <= shape[1]
        if not is_inside or any(edge % unit for edge in self):
            raise ValueError(
                f"{self} does not fit an image of the shape {shape}; expected a part of it whose "
                f"edges are multiples of {unit}"
            )

    def joined(self, other: Window) -> Window:
        """Return the smallest window that contains both; an empty one is ignored."""
        if self.is_empty or other.is_empty:
            return other if self.is_empty else self
        return Window(
            min(self.top, other.top),
            max(self.bottom, other.bottom),
            min(self.left, other.left),
            max(self.right, other.right),
        )

    def grown(self, margin_px: int, shape: tuple[int, ...]) -> Window:
        """Return the window, unless empty, with a margin and edges at multiples of 8."""
        top, bottom, left, right = self
        if bottom <= top or right <= left:
            return Window(0, 0, 0, 0)
        return Window(
            max((top - margin_px) // 8 * 8, 0),
            min((bottom + margin_px + 7) // 8 * 8, shape[0]),
            max((left - margin_px) // 8 * 8, 0),
            min((right + margin_px + 7) // 8 * 8, shape[1]),
        )


def window_of(image: ImageArray) -> Window:
    """Return the window of the pixels of an image (H, W), uint8, that are not 0, if any."""
    check_array("image", image, (ANY, ANY))
    left, top, width, height = cv2.boundingRect(image) if image.size else (0, 0, 0, 0)
    return Window(top, top + height, left, left + width)
