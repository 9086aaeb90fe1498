"""Silhouettes that are drawn by hand, 240 rows of 320 pixels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest


def _block(top: int, bottom: int, left: int, right: int) -> np.ndarray:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[top:bottom, left:right] = 255
    return silhouette


def _outstretched(drop: float = 0.0, left_px: int = 80, right_px: int = 80) -> np.ndarray:
    image: np.ndarray = _block(95, 220, 140, 180) | _block(60, 95, 152, 168)
    for side, reach in ((1, right_px), (-1, left_px)):
        for i in range(reach):
            column = 160 + i if side > 0 else 159 - i
            row = round(100 + drop * i)
            image[row - 4 : row + 4, column] = 255
    return image


@pytest.fixture
def block() -> Callable[..., np.ndarray]:
    """Draw a rectangle from the rows ``top``, ``bottom`` and the columns ``left``, ``right``."""
    return _block


@pytest.fixture
def outstretched() -> Callable[..., np.ndarray]:
    """Trunk 40 px wide, head 16 px, arms 8 px thick at row 100 that fall by ``drop`` a pixel."""
    return _outstretched
