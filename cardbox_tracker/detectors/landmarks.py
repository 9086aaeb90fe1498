"""Names of the 33 points of MediaPipe's pose network, and their conversion for the tracker."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.detectors.pose_network import Detection

LANDMARKS = (
    "nose",
    "left_eye_inner",
    "left_eye",
    "left_eye_outer",
    "right_eye_inner",
    "right_eye",
    "right_eye_outer",
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_little_finger",
    "right_little_finger",
    "left_index",
    "right_index",
    "left_thumb",
    "right_thumb",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_heel",
    "right_heel",
    "left_foot",
    "right_foot",
)
"""``left`` is the person's left; fingers are their knuckles at the base."""

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
