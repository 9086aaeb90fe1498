"""Depth images as ROS has them (REP 118): 16UC1 in millimetres, 32FC1 in metres."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import EncodingError
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.encodings import image_parts

DepthImage = NDArray[np.float32]

_LONGEST_PX = 32_766
_KINDS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}


def decode_depth(
    data: Any, height: int, width: int, step: int, encoding: str, is_bigendian: bool
) -> DepthImage:
    """Return a depth image (H, W), metres along the optical axis; 0 where nothing was measured.

    Raises:
        EncodingError: it is no depth image, or the bytes do not fit it.
    """
    if encoding not in _KINDS:
        raise EncodingError(
            f"encoding '{encoding}' is no depth; expected 16UC1 (millimetres) or 32FC1 (metres)"
        )
    code, metres = _KINDS[encoding]
    kind = np.dtype(f"{'>' if is_bigendian else '<'}{code}")
    row_bytes = width * kind.itemsize
    raw = np.frombuffer(data, np.uint8)
    if height <= 0 or width <= 0 or step < row_bytes or len(raw) < height * step:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has rows of {step} bytes and {len(raw)} bytes "
            f"in all; expected {row_bytes} or more a row: the message is incomplete"
        )
    rows = np.ascontiguousarray(raw[: height * step].reshape(height, step)[:, :row_bytes])
    depth = rows.view(kind).reshape(height, width).astype(np.float32) * np.float32(metres)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def depth_from_image(message: Any) -> DepthImage:
    """Return the depth (H, W), metres, in a sensor_msgs/Image, of rclpy or of a recording.

    Raises:
        EncodingError: as :func:`decode_depth`.
    """
    return decode_depth(*image_parts(message))


def at_size(depth_m: DepthImage, width: int, height: int) -> DepthImage:
    """Return a depth image of that size; each pixel is one that was measured, not a mean."""
    if depth_m.shape == (height, width):
        return depth_m
    resized = cv2.resize(depth_m, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(resized, np.float32)


def as_seen_by(depth_m: DepthImage, own: Camera, camera: Camera) -> DepthImage:
    """Return a depth image as another pinhole camera at the same place has it; 0 beside its view.

    Args:
        depth_m: (H, W), of any size with the proportions of ``own``.
        own: the camera that measured it.
        camera: the camera whose pixels the result has.

    Raises:
        EncodingError: the image is longer than OpenCV can turn.
    """
    height, width = depth_m.shape
    if max(height, width) > _LONGEST_PX:
        raise EncodingError(
            f"the depth image is {width}x{height}; expected sides of at most {_LONGEST_PX} px"
        )
    own = own.scaled(width, height)
    across, down = own.fx / camera.fx, own.fy / camera.fy
    pixel_of = np.array(
        [
            (across, 0.0, own.cx - across * camera.cx),
            (0.0, down, own.cy - down * camera.cy),
        ]
    )
    seen = cv2.warpAffine(
        depth_m,
        pixel_of,
        (camera.width, camera.height),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        borderValue=0,
    )
    return np.asarray(seen, np.float32)
