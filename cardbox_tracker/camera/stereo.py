"""Measures depth in rectified image pairs with OpenCV's semi-global matching."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.common.errors import CameraError

DepthImage = NDArray[np.float32]

NEAREST_M = 0.8
"""Smallest measured distance, metres."""

# Recommended by OpenCV: penalties of 8 and 32 times the pixels of a block. Disparities are in
# sixteenths of a pixel, and their number is a multiple of 16.
_MOST_DISPARITIES = 4096
_BLOCK, _STEP, _PARTS = 5, 16, 16.0
_SMALL_STEP, _LARGE_STEP = 8 * _BLOCK**2, 32 * _BLOCK**2
_UNIQUE_PERCENT, _LEFT_RIGHT = 5, 1
_SPECKLE_PX, _SPECKLE_RANGE = 60, 2
# Of images in the right order more pixels get a depth, by half as many on walls with any texture.
_MUCH_KNOWN, _MORE = 0.5, 1.25


class StereoDepth:
    """Measures depth in the left one of two rectified images."""

    def __init__(self, fx: float, baseline_m: float, nearest_m: float = NEAREST_M) -> None:
        """Prepare the matcher for a focal length, px, and a baseline and least distance, metres.

        A smaller distance takes more time. Raises CameraError if one is not positive, or the
        cameras are too far apart for a person so near.
        """
        if not (fx > 0 and baseline_m > 0 and nearest_m > 0):
            raise CameraError(
                f"stereo with a focal length of {fx:g} px and a baseline of {baseline_m:g} m; "
                "expected a rectified pair, whose right camera has P[0,3] = -fx B below 0: is the "
                "left camera the first one?"
            )
        if not fx * baseline_m / nearest_m <= _MOST_DISPARITIES:
            raise CameraError(
                f"stereo with a focal length of {fx:g} px and a baseline of {baseline_m:g} m would "
                f"need more than {_MOST_DISPARITIES} disparities; expected metres, such as 0.12: "
                "are they millimetres?"
            )
        self._scale = fx * baseline_m
        most = _STEP * math.ceil(self._scale / nearest_m / _STEP)
        self._matcher = cv2.StereoSGBM.create(
            minDisparity=0,
            numDisparities=most,
            blockSize=_BLOCK,
            P1=_SMALL_STEP,
            P2=_LARGE_STEP,
            disp12MaxDiff=_LEFT_RIGHT,
            uniquenessRatio=_UNIQUE_PERCENT,
            speckleWindowSize=_SPECKLE_PX,
            speckleRange=_SPECKLE_RANGE,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def __call__(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> DepthImage:
        """Return the depth (H, W), metres along the optical axis; 0 where none was found.

        The images are rectified, of one size, (H, W) grey or (H, W, 3) bgr.
        """
        pair = (np.ascontiguousarray(brightness_of(image)) for image in (left, right))
        disparity = np.asarray(self._matcher.compute(*pair), np.float32) / np.float32(_PARTS)
        depth = np.zeros_like(disparity)
        np.divide(np.float32(self._scale), disparity, out=depth, where=disparity > 0)
        return depth

    def seem_swapped(
        self, left: NDArray[np.uint8], right: NDArray[np.uint8], depth: DepthImage
    ) -> bool:
        """Return whether images of a measurement seem to be those of each other's camera.

        This takes as long as one measurement, unless ``depth`` knows much.
        """
        known = np.count_nonzero(depth)
        if known > _MUCH_KNOWN * depth.size:
            return False
        return bool(np.count_nonzero(self(right, left)) > _MORE * known)


def stereo_of_pair(
    left: Camera, right: Camera, where: Extrinsics, nearest_m: float = NEAREST_M
) -> StereoDepth:
    """Create the depth measurement of a rectified pair of cameras whose images have one size.

    ``where`` are the extrinsics of the right one relative to the left one. Raises CameraError if
    they are no rectified pair with the left camera first.
    """
    x, *rest = where.translation_m.tolist()
    one, other = ((c.fx, c.fy, c.cx, c.cy) for c in (left, right))
    is_parallel = np.allclose(where.rotation, np.eye(3), atol=1e-3) and max(map(abs, rest)) < 0.01
    if not (is_parallel and np.allclose(one, other, atol=0.5)):
        raise CameraError(
            f"the first two cameras are no rectified pair: {where}; expected equal focal lengths "
            "and principal points, cameras beside each other. Rectify them with stereo_image_proc"
        )
    return StereoDepth(left.fx, -x, nearest_m)
