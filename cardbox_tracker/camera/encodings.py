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
from cardbox_tracker.camera.levels import Levels
from cardbox_tracker.common.errors import EncodingError, quoted

ImageArray = NDArray[np.uint8]

_AS_STORED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH

MOST_PIXELS = 2**25
"""Slightly more than an 8K image; larger images are refused before memory is allocated."""


class _Encoding(NamedTuple):
    """Bytes per pixel, channels of the array, OpenCV's codes to grey and bgr (None: unchanged).

    An encoding of 16 bits has the codes of the eight bits that its images are scaled to.
    """

    bytes_per_pixel: int
    channels: int
    to_grey: int | None
    to_bgr: int | None

    @property
    def of_16_bits(self) -> _Encoding:
        return self._replace(bytes_per_pixel=2 * self.bytes_per_pixel)


_MONO = _Encoding(1, 1, None, cv2.COLOR_GRAY2BGR)
_BGR = _Encoding(3, 3, cv2.COLOR_BGR2GRAY, None)
_RGB = _Encoding(3, 3, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR)
_BGRA = _Encoding(4, 4, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR)
_RGBA = _Encoding(4, 4, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR)
_UYVY = _Encoding(2, 2, cv2.COLOR_YUV2GRAY_UYVY, None)
_YUYV = _Encoding(2, 2, cv2.COLOR_YUV2GRAY_YUY2, None)
_RGGB = _Encoding(1, 1, cv2.COLOR_BayerBG2GRAY, cv2.COLOR_BayerBG2BGR)
_BGGR = _Encoding(1, 1, cv2.COLOR_BayerRG2GRAY, cv2.COLOR_BayerRG2BGR)
_GBRG = _Encoding(1, 1, cv2.COLOR_BayerGR2GRAY, cv2.COLOR_BayerGR2BGR)
_GRBG = _Encoding(1, 1, cv2.COLOR_BayerGB2GRAY, cv2.COLOR_BayerGB2BGR)
# Brightness of all pixels, followed by their colours in pairs of bytes.
_NV12 = _Encoding(1, 1, None, cv2.COLOR_YUV2BGR_NV12)
_NV21 = _Encoding(1, 1, None, cv2.COLOR_YUV2BGR_NV21)
_NV24 = _Encoding(1, 1, None, None)
_ENCODINGS = MappingProxyType(
    {
        "mono8": _MONO,
        "8UC1": _MONO,
        "mono16": _MONO.of_16_bits,
        "16UC1": _MONO.of_16_bits,
        "rgb8": _RGB,
        "bgr8": _BGR,
        "8UC3": _BGR,
        "rgba8": _RGBA,
        "bgra8": _BGRA,
        "8UC4": _BGRA,
        "rgb16": _RGB.of_16_bits,
        "bgr16": _BGR.of_16_bits,
        "16UC3": _BGR.of_16_bits,
        "rgba16": _RGBA.of_16_bits,
        "bgra16": _BGRA.of_16_bits,
        "16UC4": _BGRA.of_16_bits,
        "yuv422": _UYVY,
        "uyvy": _UYVY,
        "yuv422_yuy2": _YUYV,
        "yuyv": _YUYV,
        "nv12": _NV12,
        "nv21": _NV21,
        "nv24": _NV24,
        "bayer_rggb8": _RGGB,
        "bayer_bggr8": _BGGR,
        "bayer_gbrg8": _GBRG,
        "bayer_grbg8": _GRBG,
        "bayer_rggb16": _RGGB.of_16_bits,
        "bayer_bggr16": _BGGR.of_16_bits,
        "bayer_gbrg16": _GBRG.of_16_bits,
        "bayer_grbg16": _GRBG.of_16_bits,
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
    data: Any,
    height: int,
    width: int,
    step: int,
    encoding: str,
    is_bigendian: bool = False,
    levels: Levels | None = None,
) -> ImageArray:
    """Return the brightness (H, W) uint8 of an image; mono8 is not copied.

    Args:
        data: the bytes, as bytes, array.array or uint8 array.
        height: rows.
        width: columns.
        step: bytes per row, padding included.
        encoding: one of ``SUPPORTED_ENCODINGS``.
        is_bigendian: byte order of 16 bits.
        levels: what scales 16 bits, the same for all images of a camera; without it, the range of
            this image counts.

    Raises:
        EncodingError: the encoding is not supported, or the bytes do not fit it.
    """
    raw, kind = _pixels(data, height, width, step, encoding, is_bigendian, levels)
    if encoding.startswith("nv"):
        return np.ascontiguousarray(raw[:height])
    return raw if kind.to_grey is None else np.asarray(cv2.cvtColor(raw, kind.to_grey), np.uint8)


def decode_bgr(
    data: Any,
    height: int,
    width: int,
    step: int,
    encoding: str,
    is_bigendian: bool = False,
    levels: Levels | None = None,
) -> ImageArray:
    """Return the colours (H, W, 3) uint8, bgr, of an image; see :func:`decode_grey`.

    Raises:
        EncodingError: the encoding is not supported, or the bytes do not fit it.
    """
    raw, kind = _pixels(data, height, width, step, encoding, is_bigendian, levels)
    if encoding == "nv24":
        return _full_range(raw[:height], raw[height:].reshape(height, width, 2))
    if kind.channels == 2:
        luma = 1 if kind is _UYVY else 0
        colours = raw[..., 1 - luma].reshape(height, width // 2, 2)
        return _full_range(
            raw[..., luma], cv2.resize(colours, (width, height), interpolation=cv2.INTER_NEAREST)
        )
    return raw if kind.to_bgr is None else np.asarray(cv2.cvtColor(raw, kind.to_bgr), np.uint8)


def _full_range(brightness: ImageArray, colours: NDArray[Any]) -> ImageArray:
    """Return bgr of a brightness (H, W), which it keeps, and colours (H, W, 2), u and v."""
    yuv = np.dstack([brightness, colours])
    return np.asarray(cv2.cvtColor(yuv, cv2.COLOR_YUV2BGR), np.uint8)


def decode_as_sent(
    data: Any,
    height: int,
    width: int,
    step: int,
    encoding: str,
    is_bigendian: bool = False,
    most_pixels: float = MOST_PIXELS,
    levels: Levels | None = None,
) -> ImageArray:
    """Return bgr (H, W, 3) uint8 of a colour image, brightness (H, W) uint8 of a grey one.

    Raises:
        EncodingError: the encoding is not supported, the bytes do not fit it, or the image has more
            than ``most_pixels``.
    """
    check_pixels(width, height, most_pixels)
    is_grey = encoding.startswith("mono") or encoding in ("8UC1", "16UC1")
    decode = decode_grey if is_grey else decode_bgr
    return decode(data, height, width, step, encoding, is_bigendian, levels)


def decode_compressed(
    data: Any, most_pixels: float = MOST_PIXELS, levels: Levels | None = None
) -> ImageArray:
    """Return a JPEG or PNG image as (H, W) grey or (H, W, 3) bgr, uint8.

    Args:
        data: the bytes of the file.
        most_pixels: larger images are refused before memory is allocated.
        levels: see :func:`decode_grey`.

    Raises:
        EncodingError: the bytes cannot be decoded as an image, or it is too large.
    """
    raw = np.frombuffer(data, np.uint8)
    check_pixels(*compressed_size(raw.tobytes()), most_pixels)
    try:
        image = None if _is_cut_off(raw) else cv2.imdecode(raw, _AS_STORED)
    except cv2.error:
        image = None
    if image is None:
        raise EncodingError(
            f"the compressed image ({len(raw)} bytes) cannot be decoded; expected whole JPEG or "
            "PNG data: check the camera's transport"
        )
    if image.dtype == np.uint16:
        return (levels or Levels())(image)
    return np.asarray(image, np.uint8)


def _is_cut_off(raw: ImageArray) -> bool:
    """Return whether data is empty or a truncated JPEG, which older OpenCV fills with grey."""
    data = raw.tobytes()
    # The marker cannot occur within a scan; a thumbnail, which has one too, lies before it.
    is_jpeg = data.startswith(b"\xff\xd8")
    return not data or (is_jpeg and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"))


def _pixels(
    data: Any,
    height: int,
    width: int,
    step: int,
    encoding: str,
    is_bigendian: bool,
    levels: Levels | None,
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
    has_pairs = kind.channels == 2 or encoding in ("nv12", "nv21")
    if (has_pairs and width % 2) or (encoding in ("nv12", "nv21") and height % 2):
        raise EncodingError(
            f"a {encoding} image is {width} wide and {height} high; expected an even width"
            + (" and height" if encoding.startswith("nv") else "")
        )
    if encoding.startswith("bayer") and min(width, height) < 3:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} is too small to interpolate its colours; "
            "expected 3x3 or more"
        )
    raw, rows = np.frombuffer(data, np.uint8), height
    if encoding.startswith("nv"):
        rows = 3 * height if encoding == "nv24" else height * 3 // 2
        # Some drivers count the bytes of the colours into the rows of the brightness.
        step = step if len(raw) >= rows * step else width
    if len(raw) < rows * step:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has {len(raw)} bytes; expected "
            f"{rows * step}: the message is incomplete"
        )
    pixels = raw[: rows * step].reshape(rows, step)[:, :row_bytes]
    if kind.bytes_per_pixel == 2 * kind.channels:
        words = np.ascontiguousarray(pixels).view(">u2" if is_bigendian else "<u2")
        pixels = (levels or Levels())(words)
    if kind.channels == 1:
        return np.ascontiguousarray(pixels), kind
    return np.ascontiguousarray(pixels).reshape(height, width, kind.channels), kind


def brightness_of(image: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the brightness (H, W) of an image that is grey (H, W) or bgr (H, W, 3)."""
    if image.ndim == 2:
        return np.asarray(image, np.uint8)
    return np.asarray(cv2.cvtColor(np.asarray(image, np.uint8), cv2.COLOR_BGR2GRAY), np.uint8)
