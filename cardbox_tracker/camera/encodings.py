"""Decodes camera images to brightness or colour.

The names are those of ``sensor_msgs/image_encodings``. A Bayer pattern is named after the colours
of the first row's first two pixels and the second row's first two. OpenCV names the same pattern
after the second row's second and third pixel, so the names in the table below differ.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.image_headers import check_pixels, compressed_size
from cardbox_tracker.common.errors import EncodingError, quoted

ImageArray = NDArray[np.uint8]

MOST_PIXELS = 2**25
"""Slightly more than an 8K image; larger images are refused before memory is allocated."""


class _Encoding(NamedTuple):
    """Bytes per pixel, channels of the array, OpenCV's codes to grey and bgr (None: unchanged)."""

    bytes_per_pixel: int
    channels: int
    to_grey: int | None
    to_bgr: int | None


_ENCODINGS = MappingProxyType(
    {
        "mono8": _Encoding(1, 1, None, cv2.COLOR_GRAY2BGR),
        "mono16": _Encoding(2, 1, None, cv2.COLOR_GRAY2BGR),
        "rgb8": _Encoding(3, 3, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR),
        "bgr8": _Encoding(3, 3, cv2.COLOR_BGR2GRAY, None),
        "rgba8": _Encoding(4, 4, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR),
        "bgra8": _Encoding(4, 4, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR),
        "yuv422": _Encoding(2, 2, cv2.COLOR_YUV2GRAY_UYVY, cv2.COLOR_YUV2BGR_UYVY),
        "yuv422_yuy2": _Encoding(2, 2, cv2.COLOR_YUV2GRAY_YUY2, cv2.COLOR_YUV2BGR_YUY2),
        "bayer_rggb8": _Encoding(1, 1, cv2.COLOR_BayerBG2GRAY, cv2.COLOR_BayerBG2BGR),
        "bayer_bggr8": _Encoding(1, 1, cv2.COLOR_BayerRG2GRAY, cv2.COLOR_BayerRG2BGR),
        "bayer_gbrg8": _Encoding(1, 1, cv2.COLOR_BayerGR2GRAY, cv2.COLOR_BayerGR2BGR),
        "bayer_grbg8": _Encoding(1, 1, cv2.COLOR_BayerGB2GRAY, cv2.COLOR_BayerGB2BGR),
    }
)

SUPPORTED_ENCODINGS: tuple[str, ...] = tuple(_ENCODINGS)


def image_parts(message: Any) -> tuple[Any, int, int, int, str, bool]:
    """Return the decoders' arguments from a sensor_msgs/Image of rclpy or of a recording."""
    return (
        message.data,
        message.height,
        message.width,
        message.step,
        message.encoding,
        bool(message.is_bigendian),
    )


def decode_grey(
    data: Any, height: int, width: int, step: int, encoding: str, is_bigendian: bool = False
) -> ImageArray:
    """Return the brightness (H, W) uint8 of an image; mono8 is not copied.

    Args:
        data: the bytes, as bytes, array.array or uint8 array.
        height: rows.
        width: columns.
        step: bytes per row, padding included.
        encoding: one of ``SUPPORTED_ENCODINGS``.
        is_bigendian: byte order of mono16.

    Raises:
        EncodingError: the encoding is not supported, or the bytes do not fit it.
    """
    raw, kind = _pixels(data, height, width, step, encoding, is_bigendian)
    return raw if kind.to_grey is None else np.asarray(cv2.cvtColor(raw, kind.to_grey), np.uint8)


def decode_bgr(
    data: Any, height: int, width: int, step: int, encoding: str, is_bigendian: bool = False
) -> ImageArray:
    """Return the colours (H, W, 3) uint8, bgr, of an image; see :func:`decode_grey`.

    Raises:
        EncodingError: the encoding is not supported, or the bytes do not fit it.
    """
    raw, kind = _pixels(data, height, width, step, encoding, is_bigendian)
    return raw if kind.to_bgr is None else np.asarray(cv2.cvtColor(raw, kind.to_bgr), np.uint8)


def decode_as_sent(
    data: Any,
    height: int,
    width: int,
    step: int,
    encoding: str,
    is_bigendian: bool = False,
    most_pixels: float = MOST_PIXELS,
) -> ImageArray:
    """Return bgr (H, W, 3) uint8 of a colour image, brightness (H, W) uint8 of a grey one.

    Raises:
        EncodingError: the encoding is not supported, the bytes do not fit it, or the image has more
            than ``most_pixels``.
    """
    check_pixels(width, height, most_pixels)
    decode = decode_grey if encoding.startswith("mono") else decode_bgr
    return decode(data, height, width, step, encoding, is_bigendian)


def decode_compressed(data: Any, most_pixels: float = MOST_PIXELS) -> ImageArray:
    """Return a JPEG or PNG image as (H, W) grey or (H, W, 3) bgr, uint8.

    Args:
        data: the bytes of the file.
        most_pixels: larger images are refused before memory is allocated.

    Raises:
        EncodingError: the bytes cannot be decoded as an image, or it is too large.
    """
    raw = np.frombuffer(data, np.uint8)
    check_pixels(*compressed_size(raw.tobytes()), most_pixels)
    try:
        image = None if _is_cut_off(raw) else cv2.imdecode(raw, cv2.IMREAD_ANYCOLOR)
    except cv2.error:
        image = None
    if image is None:
        raise EncodingError(
            f"the compressed image ({len(raw)} bytes) cannot be decoded; expected whole JPEG or "
            "PNG data: check the camera's transport"
        )
    return np.asarray(image, np.uint8)


def _is_cut_off(raw: ImageArray) -> bool:
    """Return whether data is empty or a truncated JPEG, which older OpenCV fills with grey."""
    data = raw.tobytes()
    # The marker cannot occur within a scan; a thumbnail, which has one too, lies before it.
    is_jpeg = data.startswith(b"\xff\xd8")
    return not data or (is_jpeg and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"))


def _pixels(
    data: Any, height: int, width: int, step: int, encoding: str, is_bigendian: bool
) -> tuple[ImageArray, _Encoding]:
    """Return the image as an array in its own layout, and its encoding."""
    check_pixels(width, height, MOST_PIXELS)
    kind = _ENCODINGS.get(encoding)
    if kind is None:
        raise EncodingError(
            f"encoding {quoted(encoding)} is not supported; supported are "
            f"{', '.join(SUPPORTED_ENCODINGS)}: set the camera driver to one of them"
        )
    row_bytes = width * kind.bytes_per_pixel
    if height <= 0 or width <= 0:
        raise EncodingError(
            f"a {encoding} image has the size {width}x{height}; expected one pixel or more: the "
            "message is empty"
        )
    if step < row_bytes:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has rows of {step} bytes; expected "
            f"{row_bytes} or more"
        )
    if kind.channels == 2 and width % 2:
        raise EncodingError(f"a {encoding} image is {width} wide; expected an even width")
    if encoding.startswith("bayer") and min(width, height) < 3:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} is too small to interpolate its colours; "
            "expected 3x3 or more"
        )
    raw = np.frombuffer(data, np.uint8)
    if len(raw) < height * step:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has {len(raw)} bytes; expected "
            f"{height * step}: the message is incomplete"
        )
    rows = raw[: height * step].reshape(height, step)[:, :row_bytes]
    if encoding == "mono16":
        # The high byte is the brightness in eight bits.
        return np.ascontiguousarray(rows[:, 0 if is_bigendian else 1 :: 2]), kind
    if kind.channels == 1:
        return (rows if step == row_bytes else np.ascontiguousarray(rows)), kind
    return np.ascontiguousarray(rows).reshape(height, width, kind.channels), kind


def brightness_of(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the brightness (H, W) of an image that is grey (H, W) or bgr (H, W, 3)."""
    if image.ndim == 2:
        return np.asarray(image, np.uint8)
    return np.asarray(cv2.cvtColor(np.asarray(image, np.uint8), cv2.COLOR_BGR2GRAY), np.uint8)
