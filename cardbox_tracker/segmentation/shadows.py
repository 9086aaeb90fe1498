"""Distinguishes shadows from dark clothes by their soft edge.

Both darken the wall without changing its colour. But cloth ends within a pixel or two, and a shadow
fades over many. The background is therefore flooded into dark pixels where the relative brightness
changes slowly. The flood covers a shadow and stops at the outline of cloth.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.segmentation.regions import SQUARE, flooded
from cardbox_tracker.segmentation.window import Window

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]

# Half the width of the square in which the brightness is compared, px.
_REACH_PX = 2
_CROSS = np.asarray(cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3)), np.uint8)


def decide_shadows(
    foreground: ImageArray,
    difference: FloatImage,
    per_level: FloatImage,
    colored: ImageArray | None,
    darkest: float,
    softest: float,
    window: Window | None = None,
) -> None:
    """Add coloured pixels to ``foreground`` and remove soft shadows from it, in place.

    The foreground (H, W), 0 or 255, was found by brightness alone. The darkness of a pixel is its
    ``difference`` from the background, (H, W), grey levels, times ``per_level``, one of these as a
    fraction of the background. ``colored`` is 255 where the colour differs, of the window's size;
    None without colour. A shadow is at most ``darkest``, and varies around a pixel by ``softest``
    at most. ``window`` contains all foreground.

    Raises ValueError if the arrays differ in shape or type, one is read-only, or the window is not
    in the image.
    """
    check_array("foreground", foreground, (ANY, ANY), is_written=True)
    shape = foreground.shape
    window = window or Window(0, shape[0], 0, shape[1])
    check_array("difference", difference, shape, np.float32, is_written=True)
    check_array("per_level", per_level, shape, np.float32, is_written=True)
    sides = window.bottom - window.top, window.right - window.left
    if colored is not None:
        check_array("colored", colored, sides)
    window.check_within(shape, 1)
    seen, darkness = foreground[window.slices], difference[window.slices] * per_level[window.slices]
    is_dark = np.zeros(shape, np.bool_)
    is_dark[window.slices] = (seen > 0) & (darkness < 0.0) & (darkness > np.float32(-darkest))
    if colored is not None:
        is_dark[window.slices] &= colored == 0
        seen |= colored
    left, top, width, height = cv2.boundingRect(is_dark.view(np.uint8)) if seen.size else 4 * (0,)
    if not width:
        return
    # The margin has the neighbours of all dark pixels.
    begin = max(top - _REACH_PX, 0), max(left - _REACH_PX, 0)
    part = np.s_[begin[0] : top + height + _REACH_PX, begin[1] : left + width + _REACH_PX]
    seen, is_dark, darkness = foreground[part], is_dark[part], difference[part] * per_level[part]
    highest, lowest = (
        change(darkness, SQUARE, iterations=_REACH_PX) for change in (cv2.dilate, cv2.erode)
    )
    varies = highest - lowest
    is_soft = is_dark & (varies.reshape(seen.shape) < np.float32(softest))
    is_background = seen == 0
    shadow = is_soft & flooded(is_background, is_soft | is_background)
    # Near the outline the square reaches into the person, so the last pixels skip this test.
    for _ in range(_REACH_PX):
        near = cv2.dilate(shadow.astype(np.uint8), _CROSS).reshape(seen.shape)
        shadow |= is_dark & (near > 0)
    seen[shadow] = 0
