"""Reads brightness and chroma of colour images in one pass, as planes of one kind of value each."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import check_array
from cardbox_tracker.common.compiling import kernel

ImageArray = NDArray[np.uint8]

_i32 = np.int32


def half_size(image: NDArray[Any]) -> tuple[int, int]:
    """Return the rows and columns of an image (H, W, ...) at half its resolution."""
    height, width = image.shape[:2]
    return max(height // 2, 1), max(width // 2, 1)


def halved(image: ImageArray) -> ImageArray:
    """Return brightness, Cr and Cb (h, w, 3) of a bgr image (H, W, 3), at half its resolution."""
    height, width = half_size(image)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2YCrCb), np.uint8)


class ColorReader:
    """Reads bgr images of one size into memory that is allocated once.

    Attributes:
        brightness: brightness of the last image, (H, W), equal to OpenCV's.
        colors: its brightness, Cr and Cb at half the resolution, (3, h, w), equal to OpenCV's.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Prepare for images of the height and width ``shape``."""
        self.brightness = np.zeros(shape, np.uint8)
        self.colors = np.zeros((3, *half_size(self.brightness)), np.uint8)
        self._is_even = all(length % 2 == 0 and length for length in shape)
        if self._is_even:
            channels = np.empty((2, 3, shape[1]), np.uint8)
            means = np.empty((3, shape[1] // 2), np.int32)
            self._rows = channels, channels.view(np.uint16), means

    def read(self, image: ImageArray) -> None:
        """Take brightness and colours of a bgr image (H, W, 3), or raise ValueError."""
        height, width = self.brightness.shape
        check_array("image", image, (height, width, 3))
        if not image.size:
            raise ValueError(f"image has the shape {image.shape}; expected pixels")
        if self._is_even:
            _read(image.reshape(height, 3 * width), self._rows, self.brightness, self.colors)
        else:
            cv2.cvtColor(image, cv2.COLOR_BGR2GRAY, dst=self.brightness)
            self.colors[:] = halved(image).transpose(2, 0, 1)


@kernel
def _read(image: Any, rows: Any, brightness: Any, colors: Any) -> None:
    """Write the brightness (2 h, 2 w), and brightness, Cr and Cb (3, h, w) of squares of 2x2 px.

    ``image`` is (2 h, 6 w). The scratch ``rows`` are the channels of two rows, (2, 3, 2 w) uint8;
    the same memory as pairs of pixels, (2, 3, w) uint16; means of the squares' channels, (3, w)
    int32.
    """
    channels, pairs, means = rows
    height, width = colors.shape[1:]
    low, eight, two = _i32(255), _i32(8), _i32(2)
    for v in range(height):
        for k in range(2):
            row, out = image[2 * v + k], brightness[2 * v + k]
            blue, green, red = channels[k, 0], channels[k, 1], channels[k, 2]
            for u in range(2 * width):
                blue[u], green[u], red[u] = row[3 * u], row[3 * u + 1], row[3 * u + 2]
            # Whole numbers of 2^-15, as OpenCV has them.
            for u in range(2 * width):
                level = _i32(_i32(blue[u]) * _i32(3735) + _i32(green[u]) * _i32(19235))
                level = _i32(level + _i32(red[u]) * _i32(9798) + _i32(1 << 14))
                out[u] = _i32(level >> _i32(15))
        for k in range(3):
            above, below, mean = pairs[0, k], pairs[1, k], means[k]
            for u in range(width):
                one, other = _i32(above[u]), _i32(below[u])
                total = _i32(_i32(one & low) + _i32(one >> eight))
                total = _i32(total + _i32(other & low) + _i32(other >> eight))
                mean[u] = _i32(_i32(total + two) >> two)
        out, out_red, out_blue = colors[0, v], colors[1, v], colors[2, v]
        blues, greens, reds = means[0], means[1], means[2]
        # Here it has whole numbers of 2^-14.
        shift, half, neutral = _i32(14), _i32(1 << 13), _i32((128 << 14) + (1 << 13))
        for u in range(width):
            b, g, r = blues[u], greens[u], reds[u]
            y = _i32(_i32(b * _i32(1868) + g * _i32(9617) + r * _i32(4899) + half) >> shift)
            out[u] = y
            out_red[u] = _i32(_i32((r - y) * _i32(11682) + neutral) >> shift)
            out_blue[u] = _i32(_i32((b - y) * _i32(9241) + neutral) >> shift)
