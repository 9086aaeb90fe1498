"""Decodes depth images of REP 118, 16UC1 in mm and 32FC1 in m, also as ``compressedDepth``."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.encodings import MOST_PIXELS, SentImage
from cardbox_tracker.camera.given_arrays import depth_from
from cardbox_tracker.camera.image_headers import check_pixels, compressed_size
from cardbox_tracker.common.errors import EncodingError, quoted

DepthImage = NDArray[np.float32]

_LONGEST_PX = 32_766
# Largest difference of two aspect ratios that are meant to be one.
_ASPECT = 0.04
# Header before the PNG of a compressedDepth message: the number of the format and the two
# parameters of the inverse depths in which 32FC1 is packed.
_PACKED = struct.Struct("<iff")
_PNG = b"\x89PNG"
_KINDS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}


def decode_depth(sent: SentImage) -> DepthImage:
    """Return depth (H, W), m along the optical axis, 0 if unknown; EncodingError if it is none."""
    data, height, width, step, encoding, is_bigendian = sent
    if encoding not in _KINDS:
        raise EncodingError(
            f"encoding {quoted(encoding)} is no depth; expected 16UC1 (millimetres) or "
            "32FC1 (metres)"
        )
    check_pixels(width, height, MOST_PIXELS)
    code, metres = _KINDS[encoding]
    kind = np.dtype(f"{'>' if is_bigendian else '<'}{code}")
    row_bytes = width * kind.itemsize
    raw = np.frombuffer(data, np.uint8)
    if height <= 0 or width <= 0 or step < row_bytes or len(raw) < height * step:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has rows of {step} bytes and {len(raw)} bytes "
            f"in all; expected {row_bytes} or more a row: the message is incomplete"
        )
    padded = raw[: height * step].reshape(height, step)
    if code == "u2" and step == 2 * row_bytes and padded[:, row_bytes:].any():
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has rows of {step} bytes with numbers in all "
            f"of them; expected {row_bytes} bytes: is it 32FC1, in metres? Correct the encoding"
        )
    rows = np.ascontiguousarray(padded[:, :row_bytes])
    depth = rows.view(kind).reshape(height, width).astype(np.float32) * np.float32(metres)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def unpack_depth(data: Any, encoding: str) -> DepthImage:
    """Return the depth image (H, W), metres, in the bytes of a ``compressedDepth`` message.

    32FC1 packs a depth of z metres as the whole number n = a / z + b; 0 is unknown. ``encoding`` is
    the ``format`` of the message, such as ``16UC1; compressedDepth png``. Raises EncodingError if
    it is no depth, no PNG, or too large.
    """
    kind, _, how = encoding.partition(";")
    raw = bytes(data)
    pixels = None
    if "compressedDepth" in how and raw[_PACKED.size :].startswith(_PNG):
        check_pixels(*compressed_size(raw[_PACKED.size :]), MOST_PIXELS)
        packed = np.frombuffer(raw, np.uint8, offset=_PACKED.size)
        with contextlib.suppress(cv2.error):
            pixels = cv2.imdecode(packed, cv2.IMREAD_UNCHANGED)
    if kind not in _KINDS or pixels is None or pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise EncodingError(
            f"a compressed image of the format {quoted(encoding)} is no depth; expected "
            "'16UC1; compressedDepth png' or '32FC1; compressedDepth png'"
        )
    if kind != "32FC1":
        return np.asarray(pixels, np.float32) * np.float32(_KINDS[kind][1])
    _, a, b = _PACKED.unpack_from(raw)
    numbers = pixels.astype(np.float64) - b
    is_known = (pixels > 0) & (numbers > 0.0)
    depth = np.divide(a, numbers, out=np.zeros(pixels.shape), where=is_known)
    return np.where(np.isfinite(depth) & (depth > 0.0), depth, 0.0).astype(np.float32)


def depth_from_image(message: Any) -> DepthImage:
    """Return the depth (H, W), metres, in a sensor_msgs/Image or a packed CompressedImage.

    Raises EncodingError as :func:`decode_depth` and :func:`unpack_depth`, or if half of the known
    depths are beyond 100 m, so that they look like millimetres.
    """
    if hasattr(message, "format"):
        depth_m = unpack_depth(message.data, message.format)
    else:
        depth_m = decode_depth(SentImage.of(message))
    try:
        return depth_from(depth_m, "the depth image")
    except ValueError as error:
        raise EncodingError(str(error)) from None


def at_size(depth_m: DepthImage, width: int, height: int) -> DepthImage:
    """Resize by picking pixels, whose depth is measured; EncodingError for another aspect ratio."""
    rows, columns = depth_m.shape
    if (rows, columns) == (height, width):
        return depth_m
    # Sizes are rounded to multiples of eight pixels.
    if abs(columns * height - rows * width) > _ASPECT * rows * width:
        raise EncodingError(
            f"the depth image is {columns}x{rows}, another shape than the camera's "
            f"{width}x{height}, so it has another view; expected the depth in the "
            "camera's view, or on a topic with its own CameraInfo"
        )
    resized = cv2.resize(depth_m, (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(resized, np.float32)


def median_depth(depths_m: Sequence[DepthImage]) -> DepthImage:
    """Return the median (H, W) over depth images of one size; unknown values are left out."""
    stack = np.array(depths_m, np.float32)
    stack[~(np.isfinite(stack) & (stack > 0))] = np.nan
    # nanmedian warns where a pixel is unknown in all images.
    stack[:, np.isnan(stack).all(axis=0)] = 0.0
    return np.asarray(np.nanmedian(stack, axis=0), np.float32)


def as_seen_by(depth_m: DepthImage, own: Camera, camera: Camera) -> DepthImage:
    """Resample a depth image (H, W), metres, of ``own`` for another pinhole camera at its place.

    It is 0 outside the view. Raises EncodingError if the image is longer than OpenCV can remap.
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
