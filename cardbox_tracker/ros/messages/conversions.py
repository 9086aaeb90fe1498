"""Images and calibrations between messages and the core, without copies where possible.

Received data is an ``array.array``, which numpy reads in place. Sent data is an ``array.array``
too: rclpy checks every byte of any other type.
"""

from __future__ import annotations

import array
from types import MappingProxyType
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.camera_checks import matrix_problem
from cardbox_tracker.camera.encodings import (
    MOST_PIXELS,
    Levels,
    SentImage,
    decode_as_sent,
    decode_compressed,
)
from cardbox_tracker.camera.given_arrays import silhouette_from
from cardbox_tracker.common.errors import CameraError, EncodingError, quoted

ImageArray = NDArray[np.uint8]

# The parameters of the background node have the same limit.
_MOST_WORKING_PIXELS = 4096 * 4096

# Encodings of masks, and the types of their pixels.
_MASKS = MappingProxyType(
    {"mono8": "u1", "8UC1": "u1", "8SC1": "i1", "mono16": "u2", "16UC1": "u2", "16SC1": "i2"}
    | {"32SC1": "i4", "32FC1": "f4", "64FC1": "f8"}
)


def stamp_ns(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def image_of(
    message: Image | CompressedImage, most_pixels: float = MOST_PIXELS, levels: Levels | None = None
) -> ImageArray:
    """Return an image message as (H, W, 3) bgr, or as (H, W) if it has no colours.

    ``levels`` scales 16 bits, see :func:`.decode_grey`. Raises EncodingError if the encoding is not
    supported, the bytes do not match it, or there are more than ``most_pixels``.
    """
    if isinstance(message, CompressedImage):
        return decode_compressed(message.data, most_pixels, levels, message.format)
    return decode_as_sent(SentImage.of(message), most_pixels, levels)


def most_pixels_of(calibration: Calibration) -> float:
    """Return the most pixels to decode, 16 times those calibrated; few bytes can be gigabytes."""
    return min(MOST_PIXELS, 16.0 * calibration.width * calibration.height)


def image_behind(silhouette: ImageArray, message: Image | None) -> ImageArray | None:
    """Return the image (H, W, 3) or (H, W) of a silhouette (H, W); None without a message.

    Raises CameraError if image and silhouette differ in size, and EncodingError if the encoding is
    not supported or the bytes do not match it.
    """
    if message is None:
        return None
    image = image_of(message)
    if image.shape[:2] != silhouette.shape:
        (height, width), (rows, columns) = image.shape[:2], silhouette.shape
        raise CameraError(
            f"the image of the silhouette is {width}x{height} but the silhouette is "
            f"{columns}x{rows}; take both from one background node, or start the tracker with "
            "use_image:=false"
        )
    return image


def silhouette_of(message: Image) -> ImageArray:
    """Return the silhouette (H, W), 0 or 255, of a mask with one number for each pixel.

    :func:`~cardbox_tracker.camera.given_arrays.silhouette_from` says which pixels are the person.
    Raises EncodingError if the encoding is not that of a mask, the bytes do not match the size, or
    the values are impossible.
    """
    if message.encoding not in _MASKS:
        raise EncodingError(
            f"the silhouette has encoding {quoted(message.encoding)}; expected mono8 with 0 for "
            "the background and 255 for the person, as the background node publishes it"
        )
    kind = np.dtype(_MASKS[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
    data = np.frombuffer(message.data, dtype=np.uint8)
    height, width, step = message.height, message.width, message.step
    row_bytes = width * kind.itemsize
    if width == 0 or height == 0 or step < row_bytes or data.size < step * height:
        raise EncodingError(
            f"the silhouette claims {width}x{height} with {step} bytes a row but has {data.size} "
            f"bytes; expected step x height bytes, and a step of at least {row_bytes}"
        )
    rows = data[: step * height].reshape(height, step)[:, :row_bytes]
    try:
        return silhouette_from(np.ascontiguousarray(rows).view(kind), "the silhouette")
    except ValueError as error:
        raise EncodingError(str(error)) from None


def image_message(header: Header, image: NDArray[Any], encoding: str = "") -> Image:
    """Return a message of (H, W) or (H, W, 3), uint8 or float32, mono8 or bgr8 by default."""
    contiguous = np.ascontiguousarray(image)
    message = Image(
        header=header,
        height=contiguous.shape[0],
        width=contiguous.shape[1],
        encoding=encoding or ("mono8" if image.ndim == 2 else "bgr8"),
        is_bigendian=0,
        step=contiguous.strides[0],
    )
    data = array.array("B")
    data.frombytes(contiguous.data.cast("B"))
    message.data = data
    return message


def camera_info_message(
    header: Header, camera: Camera, source: CameraInfo | None = None
) -> CameraInfo:
    """Return a pinhole camera's CameraInfo, with R and the baseline in P of ``source``."""
    message = _info(header, camera, "plumb_bob", np.zeros(5))
    if source is not None:
        r, p = ([float(value) for value in values] for values in (source.r, source.p))
        if np.isfinite(r).all() and any(r):
            message.r = r
        if min(p[0], p[5]) > 0:
            at = camera.fx * (p[3] / p[0]), camera.fy * (p[7] / p[5])
            if np.isfinite(at).all():
                message.p[3], message.p[7] = at
    return message


def depth_camera_of(message: CameraInfo) -> Camera | None:
    """Return the pinhole camera of a rectified depth image; None if the message has none."""
    p, width, height = np.array(message.p).reshape(3, 4), int(message.width), int(message.height)
    if min(width, height) <= 0 or matrix_problem(p[:, :3], width, height):
        return None
    fx, fy, cx, cy = (float(p[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    return Camera(width, height, fx, fy, cx, cy)


def calibration_message(header: Header, calibration: Calibration) -> CameraInfo:
    """Return the CameraInfo of a real camera, as its driver publishes it."""
    return _info(header, calibration, calibration.distortion_model, calibration.distortion)


def _info(
    header: Header, lens: Camera | Calibration, model: str, distortion: NDArray[np.float64]
) -> CameraInfo:
    return CameraInfo(
        header=header,
        width=lens.width,
        height=lens.height,
        distortion_model=model,
        d=np.asarray(distortion, float).tolist(),
        k=np.asarray(lens.k, float).ravel(),
        r=np.eye(3).ravel(),
        p=np.insert(np.asarray(lens.k, float), 3, 0.0, axis=1).ravel(),
    )


def is_same_info(one: CameraInfo, other: CameraInfo) -> bool:
    """Return whether two CameraInfo describe the same camera, at any times."""
    return one.header.frame_id == other.header.frame_id and all(
        np.array_equal(getattr(one, name), getattr(other, name))
        for name in ("width", "height", "k", "d", "r", "p")
    )


def camera_of(message: CameraInfo) -> Camera:
    """Return the pinhole camera of a ``silhouette/camera_info``, or raise CameraError."""
    k = message.k
    pixels = message.width * message.height
    if pixels > _MOST_WORKING_PIXELS:
        raise CameraError(
            f"the silhouette's CameraInfo is for {message.width}x{message.height} px; expected a "
            "working size of at most 4096x4096: set width and height of the background node"
        )
    if pixels == 0:
        problem = f"is for an image of {message.width}x{message.height}"
    else:
        problem = matrix_problem(np.array(k).reshape(3, 3), message.width, message.height)
        problem = problem and f"is not calibrated: its matrix K {problem}"
    if problem:
        raise CameraError(
            f"the silhouette's CameraInfo {problem}; take the silhouette and its camera_info from "
            "the background node"
        )
    if any(message.d):
        raise CameraError(
            "the silhouette's CameraInfo has lens distortion; expected a rectified silhouette as "
            "the background node publishes it"
        )
    return Camera(
        int(message.width), int(message.height), float(k[0]), float(k[4]), float(k[2]), float(k[5])
    )
