"""Tells images that show nothing, because they are black or white nearly everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.health import WATCHES

# Every so many pixels are looked at, and so large a share of them has to be dark or saturated.
_EVERY, _SHARE = 4, 0.95


def exposure_problem(image: NDArray[Any]) -> str:
    """Return what is wrong with the light of an image (H, W) or (H, W, 3) bgr; empty if nothing."""
    pixels = brightness_of(np.ascontiguousarray(image[::_EVERY, ::_EVERY]))
    low, high = np.quantile(pixels, (1.0 - _SHARE, _SHARE)).tolist()
    return WATCHES["dark"].remark(high) or WATCHES["white"].remark(low)
