"""Estimate of the hips' height before a person is measured, from the top of the head."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.stature import height_of_row_m
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import N_JOINTS

# Range of the hips' height; beyond it, the topmost row is not the top of a head.
_LOWEST_M, _HIGHEST_M = -2.5, 1.5
# Rows with at most this number of foreground pixels are noise.
_SPECK_PX = 2


def at_height_of(silhouette: NDArray[np.uint8], body: BodyModel, camera: Camera) -> BodyModel:
    """Return ``body`` with the hip height that aligns its head with the silhouette's top row.

    Args:
        silhouette: (H, W), 0 or 255, of the camera's size.
        body: body model with the person's distance and the camera's pitch.
        camera: working camera.

    Returns:
        ``body`` unchanged if the silhouette is empty or the head is cut off.
    """
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
