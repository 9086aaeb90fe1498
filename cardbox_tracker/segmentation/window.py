"""Windows that contain the foreground of an image, so that the rest need not be processed."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import kernel

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
        if not is_inside or left % unit or right % unit:
            raise ValueError(
                f"{self} does not fit an image of the shape {shape}; expected a part of it whose "
                f"columns are multiples of {unit}"
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
    """Return a window that contains all pixels of an image (H, W), uint8, that are not 0.

    It may be up to eight columns wider at either side than necessary; it is empty if all are 0.
    """
    # A read-only array would make numba compile another version.
    flags = getattr(image, "flags", None)
    if flags is None or not (flags.c_contiguous and flags.writeable and flags.aligned):
        image = np.require(image, requirements=("C", "W", "A"))
    check_array("image", image, (ANY, ANY))
    return Window(*find_edges(image))


@kernel
def find_edges(image: Any) -> Any:
    """Return first and end row, first and end column (by 8) of the window of (H, W) uint8."""
    if image.shape[1] % 8:
        return _edges(image, 1)
    return _edges(image.view(np.uint64), 8)


@kernel
def _edges(words: Any, pixels: Any) -> Any:
    """Return the edges of a window, given so many pixels of a row in each number."""
    height, width = words.shape
    if width == 0:
        return 0, 0, 0, 0
    top, bottom = height, 0
    columns = np.zeros(width, words.dtype)
    for v in range(height):
        row = words[v, 0] & np.uint8(0)
        for u in range(width):
            row |= words[v, u]
            columns[u] |= words[v, u]
        if row != 0:
            top, bottom = min(top, v), v + 1
    if bottom == 0:
        return 0, 0, 0, 0
    left, right = 0, width
    while columns[left] == 0:
        left += 1
    while columns[right - 1] == 0:
        right -= 1
    return top, bottom, left * pixels, right * pixels
