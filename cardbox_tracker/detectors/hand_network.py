"""MediaPipe's hand network on LiteRT: 21 points of one hand in a square of an image."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.detectors.pose_network import (
    ColorImage,
    Network,
    Square,
    cut_out,
    turned_points,
)
from cardbox_tracker.person.sizes import FloatArray

WRIST = 0
"""The first point; then come four of each finger from its base to its tip: ``FINGERS``."""
FINGERS = ("thumb", "index", "middle", "ring", "little")

_POINTS, _INPUT_PX = 21, 224
# A hand is known to be there; a fast one is blurred.
_LEAST_PRESENCE = 0.3


class HandPoints(NamedTuple):
    """The points of one hand."""

    px: FloatArray  #: column and row of each, (21, 2); (0, 0) is the centre of the first pixel
    #: the points relative to the middle of an average hand, (21, 3), metres, as seen along the ray
    #: to it: x right, y down, z away from the camera.
    spatial_m: FloatArray

    @property
    def size_px(self) -> float:
        """Longer side of the box around the points, px."""
        return float(np.ptp(self.px, axis=0).max())


class HandNetwork:
    """Finds the points of a hand whose place is known."""

    def __init__(self, path: Path) -> None:
        """Load the network; raise CardboxError if LiteRT or the file is missing or damaged."""
        self._locate = Network(path)

    def __call__(self, image: ColorImage, square: Square) -> HandPoints | None:
        """Return the hand in a square of an image (H, W, 3), bgr; the fingers point to its top."""
        cut = cut_out(image, square, _INPUT_PX, cv2.BORDER_REPLICATE)
        placed, presence, _, spatial = self._locate(np.ascontiguousarray(cut[..., ::-1]))
        if float(presence[0, 0]) < _LEAST_PRESENCE:
            return None
        points = placed.reshape(_POINTS, 3)[:, :2].astype(np.float64) / _INPUT_PX
        spatial_m = spatial.reshape(_POINTS, 3).astype(np.float64)
        return HandPoints(square.to_image(points) - 0.5, turned_points(spatial_m, square.angle_rad))
