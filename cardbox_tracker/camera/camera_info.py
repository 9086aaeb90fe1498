"""Converts a CameraInfo message of rclpy or of a recording; only its fields are read."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_checks import matrix_problem
from cardbox_tracker.common.errors import CameraError

# Farther from the middle, relative to the image, no lens has its principal point.
_MOST_ASIDE = 0.15
LEAST_FOV_DEG, MOST_FOV_DEG = 10.0, 160.0
"""Range of fields of view across the image that cameras for people have, degrees."""
# Pixels that are more oblong belong to a calibration of another size.
_MOST_OBLONG = 0.1
# Changes by an autofocus are smaller.
_STEADY = 0.02


def unusual(k: NDArray[np.float64], width: int, height: int) -> str:
    """Return what no usual camera has in K (3, 3) before regions and binning, px; else empty."""
    focal, middle = k.diagonal()[:2], 2 * k[:2, 2] + 1
    size = np.array([width, height])
    fov_deg = 2 * math.degrees(math.atan(width / 2 / focal[0]))
    found = []
    if (np.abs(middle / size - 1) > 2 * _MOST_ASIDE).any():
        found.append(
            f"its principal point ({k[0, 2]:g}, {k[1, 2]:g}) px is far from the middle of images "
            f"of {width}x{height}; it seems to be of images of about {middle[0]:.0f}x"
            f"{middle[1]:.0f}"
        )
    if not LEAST_FOV_DEG <= fov_deg <= MOST_FOV_DEG:
        found.append(f"its field of view is {fov_deg:.3g} degrees across")
    if abs(focal[0] / focal[1] - 1) > _MOST_OBLONG:
        found.append(f"its focal lengths {focal[0]:g} and {focal[1]:g} px differ")
    if not found:
        return ""
    return (
        f"the camera's matrix is unusual: {', and '.join(found)}. Unless the camera is so, results "
        "are wrong: calibrate at the size that width and height state, before binning"
    )


# Topics of images that image_proc has rectified, whose CameraInfo is that of the raw images.
_RECTIFIED = re.compile(r"(?:^|[/_])rect(?:[/_]|$)")


def is_rectified(message: Any, image_topic: str) -> bool:
    """Return whether P describes the images of a topic: by K, which is zero, or by their name."""
    is_named = _RECTIFIED.search(image_topic) and info_array(message, "d").any()
    return bool((is_named or not info_array(message, "k").any()) and info_array(message, "p").any())


def _lens(message: Any, image_topic: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the matrix (3, 3) and the distortion (n,) of the images of a topic."""
    if is_rectified(message, image_topic):
        return info_array(message, "p").reshape(3, 4)[:, :3].copy(), np.zeros(5)
    return info_array(message, "k").reshape(3, 3), info_array(message, "d")


def is_other_lens(message: Any, first: Any) -> bool:
    """Return whether focal length or principal point of two CameraInfo differ, as image shares.

    One without a calibration is no other lens.
    """
    matrix = info_array(message, "k").reshape(3, 3)
    if matrix_problem(matrix, message.width, message.height):
        return False

    def shares(info: Any) -> NDArray[np.float64]:
        size = np.array([[info.width or 1.0], [info.height or 1.0]])
        return np.asarray(info_array(info, "k").reshape(3, 3)[:2] / size)

    k = shares(first)
    return not np.allclose(shares(message), k, rtol=_STEADY, atol=_STEADY * k[0, 0])


def info_remark(message: Any, info_topic: str, image_topic: str) -> str:
    """Return what a user should know of a valid CameraInfo; empty if all is usual."""
    k, found = _lens(message, image_topic)[0], []
    if not info_array(message, "k").any():
        found.append(
            f"K in {info_topic} is all zero, so its P is used: expected rectified images, without "
            "distortion"
        )
    elif is_rectified(message, image_topic):
        found.append(
            f"{image_topic} has rectified images by its name, so P of {info_topic} is used, and "
            "neither K nor D"
        )
    if is_unusual := unusual(k, int(message.width), int(message.height)):
        found.append(f"{info_topic}: {is_unusual}")
    return "; ".join(found)


def info_array(message: Any, name: str) -> NDArray[np.float64]:
    """Return ``k``, ``d``, ``r`` or ``p`` (n,) of a CameraInfo; ROS 1 has capital letters."""
    field = name if hasattr(message, name) else name.upper()
    return np.array(getattr(message, field), dtype=np.float64)


def info_content(message: Any) -> tuple[Any, ...]:
    """Return what the calibration follows from: a driver sends the same with each image."""
    roi = message.roi
    return (
        *(info_array(message, name).tobytes() for name in ("k", "d", "p")),
        *(message.header.frame_id, message.distortion_model, message.width, message.height),
        *(message.binning_x, message.binning_y),
        *(roi.x_offset, roi.y_offset, roi.width, roi.height),
    )


def calibration_from_info(message: Any, image_topic: str, info_topic: str) -> Calibration:
    """Return the calibration of the images that go with a sensor_msgs/CameraInfo.

    The matrix is adapted to the region of interest and to binning. R is not used, and P only if the
    images are rectified. Raises CameraError, which names both topics, if K is zero or impossible,
    or the region lies outside of the image.
    """
    k, distortion = _lens(message, image_topic)
    width, height = int(message.width), int(message.height)
    # Without a size, K cannot be checked; the size itself is refused later.
    problem = matrix_problem(k, width, height) if width > 0 < height else ""
    if problem:
        raise CameraError(
            f"the camera that publishes {image_topic} is not calibrated: the matrix K in "
            f"{info_topic} {problem}. Calibrate it with camera_calibration, or give its driver "
            "the calibration file, so that the CameraInfo has its focal length. For a first look, "
            "give the field of view: --fov DEG for a recording, or horizontal_fov_deg:=60.0 to "
            "this package's camera node"
        )
    roi = message.roi
    is_region = bool(roi.width and roi.height and (roi.width, roi.height) != (width, height))
    if is_region:
        if roi.x_offset + roi.width > width or roi.y_offset + roi.height > height:
            raise CameraError(
                f"the region of interest in {info_topic} is {roi.width}x{roi.height} px at "
                f"({roi.x_offset}, {roi.y_offset}), outside of images of {width}x{height}; "
                f"expected the part of them that {image_topic} has: correct the camera's driver, "
                "or give --fov DEG or --calibration FILE"
            )
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
        distortion,
        message.distortion_model,
        message.header.frame_id,
        told_by="CameraInfo",
        region_px=int(roi.width) if is_region else 0,
    )
