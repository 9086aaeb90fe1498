"""Tells images that show nothing, because they are black or white nearly everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of

# Every so many pixels are looked at, and so large a share of them has to be dark or saturated.
_EVERY, _SHARE = 4, 0.95
# Brightness of noise in the dark, and of a pixel that is saturated, grey levels.
_DARK, _WHITE = 24, 250


def exposure_problem(image: NDArray[Any]) -> str:
    """Return what is wrong with the light of an image (H, W) or (H, W, 3) bgr; empty if nothing."""
    pixels = brightness_of(np.ascontiguousarray(image[::_EVERY, ::_EVERY]))
    low, high = np.quantile(pixels, (1.0 - _SHARE, _SHARE)).tolist()
    if high < _DARK:
        return (
            f"the image is dark: {100 * _SHARE:.0f} % of its pixels are below {_DARK} of 255. "
            "Switch a light on, take the cover off the lens, or set a longer exposure or more gain"
        )
    if low >= _WHITE:
        return (
            f"the image is overexposed: {100 * _SHARE:.0f} % of its pixels are white. Set a "
            "shorter exposure or less gain"
        )
    return ""
