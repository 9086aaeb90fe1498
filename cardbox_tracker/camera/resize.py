"""Resizes images to the working resolution."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def to_working_size(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Resize ``image`` (H, W) or (H, W, 3) to (height, width); return the same array if it fits.

    Shrinking averages over area, which also averages the sensor's noise.
    """
    if image.shape[:2] == (height, width):
        return image
    shrinks = image.shape[0] >= height and image.shape[1] >= width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=method), dtype=np.uint8)
