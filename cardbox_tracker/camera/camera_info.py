"""Converts a CameraInfo message of rclpy or of a recording; only its fields are read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_checks import matrix_problem
from cardbox_tracker.common.errors import CameraError


def info_array(message: Any, name: str) -> NDArray[np.float64]:
    """Return ``k``, ``d``, ``r`` or ``p`` (n,) of a CameraInfo; ROS 1 has capital letters."""
    field = name if hasattr(message, name) else name.upper()
    return np.array(getattr(message, field), dtype=np.float64)


def calibration_from_info(message: Any, image_topic: str, info_topic: str) -> Calibration:
    """Return the calibration of the images that go with a sensor_msgs/CameraInfo.

    The matrix is adapted to the region of interest and to binning. R and P are not used.

    Raises:
        CameraError: the camera is not calibrated, or K has impossible values; the text names both
            topics.
    """
    k = info_array(message, "k").reshape(3, 3)
    width, height = int(message.width), int(message.height)
    # Without a size, K cannot be checked; the size itself is refused later.
    problem = matrix_problem(k, width, height) if width > 0 < height else ""
    if problem:
        raise CameraError(
            f"the camera that publishes {image_topic} is not calibrated: the matrix K in "
            f"{info_topic} {problem}. Calibrate it with camera_calibration, or give its driver "
            "the calibration file, so that the CameraInfo has its focal length. For a first look, "
            "this package's camera node assumes an ideal lens with horizontal_fov_deg:=60.0"
        )
    roi = message.roi
    if roi.width and roi.height and (roi.width, roi.height) != (width, height):
        k[0, 2] -= roi.x_offset
        k[1, 2] -= roi.y_offset
        width, height = int(roi.width), int(roi.height)
    binning_x, binning_y = max(int(message.binning_x), 1), max(int(message.binning_y), 1)
    # The centre of the first pixel is half a pixel inside the image.
    k[0] = (k[0] + (0.0, 0.0, 0.5)) / binning_x - (0.0, 0.0, 0.5)
    k[1] = (k[1] + (0.0, 0.0, 0.5)) / binning_y - (0.0, 0.0, 0.5)
    return Calibration(
        width // binning_x,
        height // binning_y,
        k,
        info_array(message, "d"),
        message.distortion_model,
        message.header.frame_id,
    )
