"""From pixels of the working image back to those of the camera's own image."""

from __future__ import annotations

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Calibration, FloatArray


def unrectified(calibration: Calibration, px: FloatArray, width: int, height: int) -> FloatArray:
    """Return where pixels (N, 2) of a working image of that size lie in the calibrated image.

    This is the inverse of :meth:`.Calibration.rectified`, and raises CameraError like that.
    """
    camera = calibration.camera(width, height)
    rays = camera.rays(px)[:, :2] @ calibration.turn()[:2, :2]
    k, lens = calibration.k, calibration.distortion
    if not calibration.is_distorted:
        return np.asarray(rays * k.diagonal()[:2] + k[:2, 2])
    if calibration.distortion_model == "equidistant":
        placed = cv2.fisheye.distortPoints(rays[:, None], k, lens[:4].reshape(4, 1))
    else:
        ahead, none = np.column_stack([rays, np.ones(len(rays))]), np.zeros(3)
        placed, _ = cv2.projectPoints(ahead, none, none, k, lens)
    return np.asarray(placed.reshape(-1, 2))
