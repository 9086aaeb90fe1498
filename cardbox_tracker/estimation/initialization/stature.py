"""How tall the person is and how high the hips are.

A silhouette does not show the hips. They lie below the shoulder joints by a fraction of the
stature (Drillis & Contini, "Body Segment Parameters", 1966). The stature follows from the height of
head and feet where both are in the image, or else from the arm span and the height of the head
above the shoulders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.initialization.skeleton import Skeleton, combined
from cardbox_tracker.vision.camera import Camera

SHOULDER_TO_HIP = 0.275
"""Height of the shoulder joints above the hip joints, of the stature; 0.288 in the source. Chosen
on rendered bodies, whose joint centres are known."""

SPAN = 0.99
"""Fingertip to fingertip of arms 10 degrees below the level, of the stature (rendered bodies)."""

CROWN_TO_SHOULDER = 0.215
"""Crown, hair included, to shoulder joint, of the stature; 0.182 without hair in the source.
Chosen on rendered bodies."""

_RANGE_M = (1.1, 2.2)
"""Statures beyond this are errors of the outline: a child of six, and a very tall adult."""
_MEAN_M = 1.68
_GUESSES_SD = np.array([0.06, 0.09, 0.12])
"""Relative standard deviations of the stature by the span, by the height of the head above the
shoulders, and of the mean of all people (rendered bodies)."""
_FEET = 0.88
"""A lower edge at less than this fraction of the stature that the upper body suggests is no foot: a
desk or the like hides the lower legs."""


def height_of_row_m(camera: Camera, row: float, distance_m: float) -> float:
    """Height above the camera's centre of what shows in ``row`` at a level distance, metres."""
    angle_rad = np.arctan2(row - camera.cy, camera.fy) + camera.pitch_rad
    return float(-distance_m * np.tan(angle_rad))


def stature_m(
    front: NDArray[np.uint8], skeleton: Skeleton, camera: Camera, distance_m: float
) -> float:
    """Return the estimated stature in metres.

    Args:
        front: silhouette (H, W) of ``front``.
        skeleton: the bones of the arms.
        camera: the working camera, pitched as it is.
        distance_m: level distance to the person.
    """
    rows = np.nonzero(np.any(front, axis=1))[0]
    crown_m = height_of_row_m(camera, rows[0] - 0.5, distance_m)
    above_m = crown_m - skeleton.shoulder_height_m
    guesses = np.array([skeleton.span_m / SPAN, above_m / CROWN_TO_SHOULDER, _MEAN_M])
    guess_m = float(np.clip(combined(guesses, _GUESSES_SD), *_RANGE_M))
    if rows[-1] < front.shape[0] - 1:
        # Nothing needs to be guessed if these are the feet, and not the edge of a desk.
        whole_m = crown_m - height_of_row_m(camera, rows[-1] + 0.5, distance_m)
        if whole_m > _FEET * guess_m and _RANGE_M[0] <= whole_m <= _RANGE_M[1]:
            return whole_m
    return guess_m
