"""How tall the person is and where the hips are, from the outline alone.

A silhouette does not show the hips. They follow from the stature by the proportions of the human
body (Drillis & Contini, "Body Segment Parameters", 1966), and the stature from whatever of the body
is in the image: the height of head and feet, or else the arm span and the height of the head
above the arms.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.camera import Camera

CROWN_TO_HIP = 0.478
"""Crown to hip joint, of the stature (0.470 in the source; hair adds to it)."""

CROWN_TO_SHOULDER = 0.19
"""Crown to shoulder joint, of the stature (0.182 in the source; hair adds to it)."""

SPAN = 0.985
"""Fingertip to fingertip of arms 10 degrees below the horizontal, of the stature."""

_RANGE_M = (1.1, 2.2)
"""Statures beyond this are errors of the outline: a child of six, and a very tall adult."""
_MEAN_M = 1.71
"""Mean stature of adults (ANSUR II, 2012, both sexes, rounded)."""
_SPAN_WEIGHT, _MEAN_WEIGHT, _SHOULDER_WEIGHT = 0.45, 0.25, 0.3
"""How the guesses are averaged: arm span and shoulder height scatter by a few per cent between
people of one stature, and the mean that everybody shares steadies them."""
_FEET = 0.88
"""A lower edge at less than this fraction of the stature that the arms suggest is no foot: a desk
or the like hides the lower legs."""
_UPPER_ARM_FROM, _UPPER_ARM_TO, _SHOULDER_AT = 0.45, 0.62, 0.78
"""Fractions of the way from the fingertips to the body's middle: from the first to the second,
beyond the elbow and short of the armpit, a column holds nothing but the arm; its middle line is
followed to the third, the height of the shoulder joint. Chosen by eye on silhouettes."""
_UPPER_ARM_SAMPLES = 12


def height_of_row_m(camera: Camera, row: float, distance_m: float) -> float:
    """Height above the camera's centre of what shows in ``row`` at a level distance, metres."""
    angle_rad = np.arctan2(row - camera.cy, camera.fy) + camera.pitch_rad
    return float(-distance_m * np.tan(angle_rad))


def stature_m(
    references: Mapping[str, NDArray[np.uint8]], camera: Camera, distance_m: float
) -> float:
    """Return the estimated stature in metres.

    Args:
        references: silhouettes (H, W) of ``front`` and ``arms``.
        camera: the working camera, pitched as it is.
        distance_m: level distance to the person.
    """
    front, arms = references["front"], references["arms"]
    rows = np.nonzero(np.any(front, axis=1))[0]
    crown_m = height_of_row_m(camera, rows[0] - 0.5, distance_m)
    guess_m = _stature_without_feet_m(arms, crown_m, camera, distance_m)
    if rows[-1] < front.shape[0] - 1:
        # Nothing needs to be guessed if these are the feet, and not the edge of a desk.
        whole_m = crown_m - height_of_row_m(camera, rows[-1] + 0.5, distance_m)
        if whole_m > _FEET * guess_m and _RANGE_M[0] <= whole_m <= _RANGE_M[1]:
            return whole_m
    return guess_m


def _stature_without_feet_m(
    arms: NDArray[np.uint8], crown_m: float, camera: Camera, distance_m: float
) -> float:
    """Stature by the arm span and the height of the head above the shoulders."""
    columns = np.nonzero(np.any(arms, axis=0))[0]
    scale = np.hypot(1.0, (np.mean(np.nonzero(arms)[0]) - camera.cy) / camera.fy)
    depth_m = distance_m / scale
    span_m = (columns[-1] - columns[0] + 1) / camera.fx * depth_m
    guesses, weights = [span_m / SPAN, _MEAN_M], [_SPAN_WEIGHT, _MEAN_WEIGHT]
    shoulder_m = _shoulder_height_m(arms, camera, distance_m)
    if shoulder_m is not None:
        guesses.append((crown_m - shoulder_m) / CROWN_TO_SHOULDER)
        weights.append(_SHOULDER_WEIGHT)
    return float(np.clip(np.average(guesses, weights=weights), *_RANGE_M))


def _shoulder_height_m(arms: NDArray[np.uint8], camera: Camera, distance_m: float) -> float | None:
    """Height of the shoulder joints: the arms' middle line, followed back to the shoulders.

    None where no upper arm was cut out.
    """
    columns = np.nonzero(np.any(arms, axis=0))[0]
    first, last = columns[0], columns[-1]
    heights = []
    for side in (-1, 1):
        end, middle = (first, (first + last) / 2) if side < 0 else (last, (first + last) / 2)
        # Between the elbow and the armpit the arm is all there is in a column.
        fractions = np.linspace(_UPPER_ARM_FROM, _UPPER_ARM_TO, _UPPER_ARM_SAMPLES)
        samples = np.round(end + fractions * (middle - end)).astype(int)
        rows = [float(np.mean(np.nonzero(arms[:, u])[0])) for u in samples if arms[:, u].any()]
        used = [u for u in samples if arms[:, u].any()]
        if len(used) < 2:
            continue
        slope, offset = np.polyfit(used, rows, 1)
        shoulder = end + _SHOULDER_AT * (middle - end)
        heights.append(height_of_row_m(camera, slope * shoulder + offset, distance_m))
    return float(np.mean(heights)) if heights else None
