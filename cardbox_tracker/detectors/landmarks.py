"""Conversion of the 33 points of MediaPipe's pose network for the tracker."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection

_USED = np.array([LANDMARKS.index(name) for name in POINT_NAMES])
_LEGS = np.array([LANDMARKS.index(name) for name in LEG_POINT_NAMES])


def image_points(found: Detection) -> ImagePoints:
    """Return the points of a detection that the tracker uses."""
    (pixels, scores, spatial_m), legs = (
        (
            found.points_px[used],
            found.scores[used],
            None if found.spatial_m is None else found.spatial_m[used],
        )
        for used in (_USED, _LEGS)
    )
    return ImagePoints(pixels, scores, spatial_m=spatial_m, legs=LegPoints(*legs))
