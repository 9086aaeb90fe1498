"""Stature and hip height of a person.

A silhouette does not show the hips; their distance below the shoulder joints is a fraction of the
stature (Drillis & Contini, "Body Segment Parameters", 1966). The stature is the distance between
head and feet if both are visible, else it is estimated from the arm span and the height of the head
above the shoulders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.skeleton import Skeleton, combined
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import N_JOINTS
from cardbox_tracker.person.proportions import STATURE_LIMITS_M

SHOULDER_TO_HIP = 0.275
"""Height of the shoulder joints above the hip joints in statures, chosen on rendered bodies with
known joint centres; 0.288 in the source."""

SPAN = 1.005
"""Distance of the fingertips in statures, with arms 10 degrees below the horizontal.

About 1.03 for men and 1.02 for women with level arms (ANSUR II), which the slope makes 1.2 %
shorter; 0.97 to 1.01 in rendered bodies of two families.
"""

CROWN_TO_SHOULDER = 0.218
"""Height of the crown with hair above the shoulder joints in statures (rendered bodies of two
families); 0.182 above the acromion, without hair, in the source."""

_MEAN_M = 1.68
_GUESSES_SD = np.array([0.06, 0.09, 0.12])
"""Relative standard deviations of the stature estimated from the span, from the height of the head
above the shoulders, and as the mean of all people (rendered bodies)."""
_FEET = 0.88
"""Least visible height, in estimated statures, at which the lower edge is taken for the feet."""


def height_of_row_m(camera: Camera, row: float, distance_m: float) -> float:
    """Return the height above the camera's centre of ``row`` at a level distance, metres."""
    angle_rad = np.arctan2(row - camera.cy, camera.fy) + camera.pitch_rad
    return float(-distance_m * np.tan(angle_rad))


def stature_m(
    front: NDArray[np.uint8], skeleton: Skeleton, camera: Camera, distance_m: float
) -> float:
    """Return the estimated stature in metres by the silhouette ``front`` (H, W) and the bones."""
    rows = np.nonzero(np.any(front, axis=1))[0]
    crown_m = height_of_row_m(camera, rows[0] - 0.5, distance_m)
    above_m = crown_m - skeleton.shoulder_height_m
    guesses = np.array([skeleton.span_m / SPAN, above_m / CROWN_TO_SHOULDER, _MEAN_M])
    guess_m = float(np.clip(combined(guesses, _GUESSES_SD), *STATURE_LIMITS_M))
    if rows[-1] < front.shape[0] - 1:
        # The lower edge can be the feet, or the edge of a desk.
        whole_m = crown_m - height_of_row_m(camera, rows[-1] + 0.5, distance_m)
        if whole_m > _FEET * guess_m and STATURE_LIMITS_M[0] <= whole_m <= STATURE_LIMITS_M[1]:
            return whole_m
    return guess_m


# Range of the hips' height; beyond it, the topmost row is not the top of a head.
_LOWEST_M, _HIGHEST_M = -2.5, 1.5
# Rows with at most this number of foreground pixels are noise.
_SPECK_PX = 2


def at_height_of(silhouette: NDArray[np.uint8], body: BodyModel, camera: Camera) -> BodyModel:
    """Return ``body`` with hips that put its head at the top of (H, W); the same if cut off."""
    rows = np.flatnonzero(np.count_nonzero(silhouette, axis=1) > _SPECK_PX)
    if rows.size == 0 or rows[0] == 0:
        return body
    head = pose(body, np.zeros(N_JOINTS)).head
    crown_above_hip_m = (
        head[2] - body.placement.hip_height_m + body_parts(body.sizes).head.height_m / 2
    )
    view = camera.with_pitch(body.camera_pose.pitch_rad)
    # X of the reference frame points to the camera, and a row's upper edge is half a pixel higher.
    crown_m = height_of_row_m(view, rows[0] - 0.5, -float(head[0]))
    hip_height_m = crown_m - float(crown_above_hip_m)
    if not _LOWEST_M <= hip_height_m <= _HIGHEST_M:
        return body
    return body.with_values(hip_height_m=hip_height_m)
