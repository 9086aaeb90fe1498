"""Where somebody stands whose size is about that of a body model, before they are measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import in_front

_LOWEST_M, _HIGHEST_M = -2.5, 1.5
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
    view = camera.with_pitch(body.camera_pose.pitch_rad)
    heights_m = np.linspace(_LOWEST_M, _HIGHEST_M, 200)
    tops = np.repeat(forward_kinematics(body, np.zeros(12)).head[None], len(heights_m), axis=0)
    tops[:, 2] += body_parts(body.sizes).head.height_m / 2 + heights_m - body.placement.hip_height_m
    optical = view.reference_to_optical(tops)
    # Far above or below a pitched camera there is no row to compare.
    seen = in_front(optical)
    off_px = np.abs(view.project(optical[seen])[:, 1] - rows[0])
    return body.with_values(hip_height_m=float(heights_m[seen][np.argmin(off_px)]))
