"""Where somebody stands whose size is about that of a body model, before they are measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.estimation.initialization.stature import height_of_row_m
from cardbox_tracker.vision.camera import Camera

# Hips of a person on any floor or step that a camera in the same room looks at; beyond it, the
# topmost row is not that of a head.
_LOWEST_M, _HIGHEST_M = -2.5, 1.5
# A row with this many foreground pixels or fewer is noise.
_SPECK_PX = 2


def at_height_of(silhouette: NDArray[np.uint8], body: BodyModel, camera: Camera) -> BodyModel:
    """Return ``body`` so high that the top of its head is that of the person in the image.

    How high the camera stands is not known before somebody is measured.

    Args:
        silhouette: (H, W), 0 or 255, of the camera's size.
        body: somebody at the person's distance, before a camera of that pitch.
        camera: working camera.

    Returns:
        ``body`` itself if nobody is in the image, or their head is above it.
    """
    rows = np.flatnonzero(np.count_nonzero(silhouette, axis=1) > _SPECK_PX)
    if rows.size == 0 or rows[0] == 0:
        return body
    head = forward_kinematics(body, np.zeros(N_JOINTS)).head
    crown_above_hip_m = (
        head[2] - body.placement.hip_height_m + body_parts(body.sizes).head.height_m / 2
    )
    view = camera.with_pitch(body.camera_pose.pitch_rad)
    # The reference frame's X points from the person to the camera; a row's upper edge is half a
    # pixel above its centre.
    crown_m = height_of_row_m(view, rows[0] - 0.5, -float(head[0]))
    hip_height_m = crown_m - float(crown_above_hip_m)
    if not _LOWEST_M <= hip_height_m <= _HIGHEST_M:
        return body
    return body.with_values(hip_height_m=hip_height_m)
