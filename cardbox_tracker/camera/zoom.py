"""Tells a camera that zooms from a CameraInfo that is wrong, by the images before and after.

Another focal length scales the image about the principal point. Small copies are compared as they
are and scaled so, without their slow changes of brightness, which light may cause.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.health import WATCHES

FloatImage = NDArray[np.float32]

# Width of the copies, and the standard deviation of the blur that is subtracted, px.
_WIDTH, _BLUR_PX = 96, 4.0
# A change that moves no corner of a copy by more is as small as by an autofocus, px.
_LEAST_PX = 2.0
# Correlation of images that are the same but for people and noise.
_SAME = 0.3
# Pixels at the edge of a scaled copy are made up.
_EDGE = np.ones((9, 9), np.uint8)
# Copies from before a change, in which a driver may have zoomed before it said so.
_EARLIER = 3


class ZoomWitness:
    """Remembers images, and says whether another calibration contradicts them."""

    def __init__(self) -> None:
        self._newest: deque[NDArray[np.uint8]] = deque(maxlen=2)
        self._earlier: deque[FloatImage] = deque(maxlen=_EARLIER)
        self._before: FloatImage | None = None
        self._after: FloatImage | None = None

    def look(self, image: NDArray[np.uint8]) -> None:
        """Take the next image, (H, W) or (H, W, 3) bgr."""
        self._newest.append(image)
        if self._before is not None and self._after is None:
            self._after = _copy(image)

    def remember(self) -> None:
        """Keep a copy of the newest image, at which the calibration is still the same."""
        self._earlier.extend(map(_copy, list(self._newest)[-1:]))

    def mark(self) -> None:
        """Note that the calibration has changed, with the newest image or the next one."""
        self._before = _copy(self._newest[0]) if self._newest else None
        self._after = None

    def contradicts(self, old: Calibration, new: Calibration) -> bool:
        """Return whether the images have not changed as the calibration has."""
        if self._before is None or self._after is None:
            return False
        step = _scaled_less_same(self._before, self._after, old, new)
        now = _copy(self._newest[-1])
        since = [_scaled_less_same(one, now, old, new) for one in self._earlier]
        wrong = WATCHES["wrong calibration"]
        return wrong.is_beyond(-step) and not (since and wrong.is_beyond(min(since)))


def _copy(image: NDArray[np.uint8]) -> FloatImage:
    size = _WIDTH, max(round(_WIDTH * image.shape[0] / image.shape[1]), 1)
    small = cv2.resize(brightness_of(image), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def _scaled_less_same(
    before: FloatImage, after: FloatImage, old: Calibration, new: Calibration
) -> float:
    """Return how much better one image fits the other if it is scaled; 0 if nothing shows it."""
    if before.shape != after.shape:
        return 0.0
    scale = _matrix(new) @ np.linalg.inv(_matrix(old))
    corners = np.array([[0, _WIDTH - 1, 0], [0, 0, before.shape[0] - 1], [1, 1, 1]])
    if np.abs(scale @ corners - corners).max() < _LEAST_PX:
        return 0.0
    size = before.shape[1], before.shape[0]
    scaled = np.asarray(
        cv2.warpAffine(before, scale[:2], size, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
    inside = cv2.warpAffine(np.ones_like(before), scale[:2], size, flags=cv2.INTER_NEAREST)
    used = cv2.erode(inside, _EDGE, borderValue=0) > 0
    fits = [_correlation(one, after, used) for one in (scaled, before)]
    return fits[0] - fits[1] if max(fits) > _SAME else 0.0


def _matrix(calibration: Calibration) -> NDArray[np.float64]:
    return np.diag([_WIDTH / calibration.width] * 2 + [1.0]) @ calibration.k


def _correlation(one: FloatImage, other: FloatImage, used: NDArray[np.bool_]) -> float:
    if not used.any():
        return 0.0
    seen = np.stack(
        [(image - cv2.GaussianBlur(image, (0, 0), _BLUR_PX))[used] for image in (one, other)]
    )
    seen -= seen.mean(axis=1, keepdims=True)
    product, spread = float(seen[0] @ seen[1]), float(np.prod(np.linalg.norm(seen, axis=1)))
    return product / max(spread, 1e-6)
