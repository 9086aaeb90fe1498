"""Decodes camera images to brightness or colour.

The names are those of ``sensor_msgs/image_encodings``. A Bayer pattern is named after the colours
of the first row's first two pixels and the second row's first two. OpenCV names the same pattern
after the second row's second and third pixel, so the names in the table below differ.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.image_headers import check_pixels, compressed_size
from cardbox_tracker.common.errors import EncodingError, quoted

# The darkest and brightest pixels of an image, which may be faulty, do not count.
_FAULTY = 0.001
# The scale changes if more of an image lies outside of the range; a person covers less.
_MOST_OUTSIDE = 0.25
# A camera whose first image would have fewer of 256 levels measures temperatures.
_FEW = 10
_EVERY = 4
_ALL = 1 << 16


def to_working_size(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Resize (H, W) or (H, W, 3) to (height, width) by means over areas; the same if it fits."""
    if image.shape[:2] == (height, width):
        return image
    shrinks = image.shape[0] >= height and image.shape[1] >= width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=method), dtype=np.uint8)


ImageArray = NDArray[np.uint8]

_AS_STORED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH

MOST_PIXELS = 2**25
"""Slightly more than an 8K image; larger images are refused before memory is allocated."""


class _Encoding(NamedTuple):
    """How the pixels of an encoding are stored."""

    channels: int  #: channels of the array
    to_grey: int | None = None  #: OpenCV's code to grey; None: unchanged
    to_bgr: int | None = None  #: OpenCV's code to bgr; None: unchanged
    word_bytes: int = 1  #: bytes of a number; those of 16 bits are scaled to eight
    #: across and down, pixels that share a colour of YUV; None for other colours. With two channels
    #: it lies beside the brightness, with one in rows below all brightness.
    shared: tuple[int, int] | None = None
    order: int = 0  #: place of the brightness in a pixel of two channels


_MONO = _Encoding(1, None, cv2.COLOR_GRAY2BGR)
_BGR = _Encoding(3, cv2.COLOR_BGR2GRAY)
_RGB = _Encoding(3, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR)
_BGRA = _Encoding(4, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR)
_RGBA = _Encoding(4, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR)
_EIGHT_BITS = {
    "mono8": _MONO,
    "8UC1": _MONO,
    "rgb8": _RGB,
    "bgr8": _BGR,
    "8UC3": _BGR,
    "rgba8": _RGBA,
    "bgra8": _BGRA,
    "8UC4": _BGRA,
    "bayer_rggb8": _Encoding(1, cv2.COLOR_BayerBG2GRAY, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": _Encoding(1, cv2.COLOR_BayerRG2GRAY, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": _Encoding(1, cv2.COLOR_BayerGR2GRAY, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": _Encoding(1, cv2.COLOR_BayerGB2GRAY, cv2.COLOR_BayerGB2BGR),
}
_ENCODINGS = _EIGHT_BITS | {
    **{name.replace("8", "16"): kind._replace(word_bytes=2) for name, kind in _EIGHT_BITS.items()},
    **dict.fromkeys(("yuv422", "uyvy"), _Encoding(2, shared=(2, 1), order=1)),
    **dict.fromkeys(("yuv422_yuy2", "yuyv"), _Encoding(2, shared=(2, 1))),
    # Brightness from 16 to 235, as OpenCV and with it cv_bridge read and write these two.
    "nv12": _Encoding(1, None, cv2.COLOR_YUV2BGR_NV12, shared=(2, 2)),
    "nv21": _Encoding(1, None, cv2.COLOR_YUV2BGR_NV21, shared=(2, 2)),
    "nv24": _Encoding(1, shared=(1, 1)),
}

SUPPORTED_ENCODINGS: tuple[str, ...] = tuple(_ENCODINGS)


class SentImage(NamedTuple):
    """An image as it is sent."""

    data: Any  #: the bytes, as bytes, array.array or uint8 array
    height: int  #: rows
    width: int  #: columns
    step: int  #: bytes per row, padding included
    encoding: str  #: one of ``SUPPORTED_ENCODINGS``, or that of a depth image
    is_bigendian: bool = False  #: byte order of numbers of more than a byte

    @classmethod
    def of(cls, message: Any) -> SentImage:
        """Return the image of a sensor_msgs/Image of rclpy or of a recording."""
        return cls(*(getattr(message, name) for name in cls._fields))


def decode_grey(sent: SentImage, levels: Levels | None = None) -> ImageArray:
    """Return the brightness (H, W) uint8 of an image; mono8 is not copied.

    ``levels`` scales 16 bits alike for all images of a camera; without it, the range of this image
    counts. Raises EncodingError if the encoding is not supported or the bytes do not fit it.
    """
    raw, kind = _pixels(sent, levels)
    if kind.shared is not None and kind.to_bgr is not None:
        return brightness_of(cv2.cvtColor(raw, kind.to_bgr))
    if kind.shared is not None:
        return np.ascontiguousarray(raw[: sent.height] if raw.ndim == 2 else raw[..., kind.order])
    return raw if kind.to_grey is None else np.asarray(cv2.cvtColor(raw, kind.to_grey), np.uint8)


def decode_bgr(sent: SentImage, levels: Levels | None = None) -> ImageArray:
    """Return the colours (H, W, 3) uint8, bgr, of an image; see :func:`decode_grey`."""
    raw, kind = _pixels(sent, levels)
    if kind.to_bgr is not None:
        return np.asarray(cv2.cvtColor(raw, kind.to_bgr), np.uint8)
    if kind.shared is None:
        return raw
    height, width, (across, down) = sent.height, sent.width, kind.shared
    if raw.ndim == 3:
        brightness, colours = raw[..., kind.order], raw[..., 1 - kind.order]
    else:
        brightness, colours = raw[:height], raw[height:]
    pairs = colours.reshape(height // down, width // across, 2)
    each = cv2.resize(np.ascontiguousarray(pairs), (width, height), interpolation=cv2.INTER_NEAREST)
    # The brightness has the full range, and is that of the grey image.
    yuv = np.dstack([brightness, each])
    return np.asarray(cv2.cvtColor(yuv, cv2.COLOR_YUV2BGR), np.uint8)


def decode_as_sent(
    sent: SentImage, most_pixels: float = MOST_PIXELS, levels: Levels | None = None
) -> ImageArray:
    """Return bgr (H, W, 3) or brightness (H, W), uint8; raise EncodingError, also if too large."""
    check_pixels(sent.width, sent.height, most_pixels)
    is_grey = sent.encoding.startswith("mono") or sent.encoding in ("8UC1", "16UC1")
    return (decode_grey if is_grey else decode_bgr)(sent, levels)


def decode_compressed(
    data: Any, most_pixels: float = MOST_PIXELS, levels: Levels | None = None, kind: str = ""
) -> ImageArray:
    """Return JPEG or PNG as (H, W) or (H, W, 3) bgr, uint8, or raise EncodingError.

    ``kind`` is the format that the message states.
    """
    raw = np.frombuffer(data, np.uint8)
    check_pixels(*compressed_size(raw.tobytes(), kind), most_pixels)
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


def _pixels(sent: SentImage, levels: Levels | None) -> tuple[ImageArray, _Encoding]:
    """Return the image as an array in its own layout, and its encoding."""
    data, height, width, step, encoding, is_bigendian = sent
    check_pixels(width, height, MOST_PIXELS)
    kind = _ENCODINGS.get(encoding)
    if kind is None:
        raise EncodingError(
            f"encoding {quoted(encoding)} is not supported; supported are "
            f"{', '.join(SUPPORTED_ENCODINGS)}: set the camera driver to one of them"
        )
    row_bytes = width * kind.channels * kind.word_bytes
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
    across, down = kind.shared or (1, 1)
    if width % across or height % down:
        raise EncodingError(
            f"a {encoding} image is {width} wide and {height} high; expected an even width"
            + (" and height" if down > 1 else "")
        )
    if encoding.startswith("bayer") and min(width, height) < 3:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} is too small to interpolate its colours; "
            "expected 3x3 or more"
        )
    raw, rows = np.frombuffer(data, np.uint8), height
    if kind.shared is not None and kind.channels == 1:
        rows += 2 * height // (across * down)
        # Some drivers count the bytes of the colours into the rows of the brightness.
        step = step if len(raw) >= rows * step else width
    if len(raw) < rows * step:
        raise EncodingError(
            f"a {encoding} image of {width}x{height} has {len(raw)} bytes; expected "
            f"{rows * step}: the message is incomplete"
        )
    pixels = raw[: rows * step].reshape(rows, step)[:, :row_bytes]
    if kind.word_bytes == 2:
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


class Levels:
    """Scales images of 16 bits to eight by the range that one camera uses.

    Infrared and thermal cameras use 10 to 14 of the bits, or a small part in the middle. All images
    of a camera get the same scale, because a background is compared with them.

    Attributes:
        text: the scale in words; empty before the first image, and if all 16 bits are used.
        changes: how often the scale was set, which a large change of the brightness does again.
    """

    def __init__(self) -> None:
        self.text, self.changes = "", 0
        self._low, self._width = 0, 0

    def __call__(self, image: NDArray[Any]) -> NDArray[np.uint8]:
        """Return an image uint16 as uint8 of the same shape."""
        sample = image[::_EVERY, ::_EVERY]
        outside = (sample < self._low) | (sample >= self._low + self._width)
        if np.mean(outside) > _MOST_OUTSIDE:
            self._set(image)
        shift = self._width.bit_length() - 9
        if self._width == _ALL:
            return (image >> shift).astype(np.uint8)
        inside = np.clip(image.astype(np.int32) - self._low, 0, self._width - 1)
        return (inside >> shift).astype(np.uint8)

    def _set(self, image: NDArray[Any]) -> None:
        low, high = (int(value) for value in np.quantile(image, (_FAULTY, 1 - _FAULTY)))
        self._low, self._width = 0, max(256, 1 << high.bit_length())
        narrow = max(256, 1 << (2 * (high - low)).bit_length())
        # A plain wall has few levels, too, and people before it need those below and above.
        if 256 * (high - low) < _FEW * self._width and narrow < self._width:
            self._low, self._width = max(0, (low + high - narrow) // 2), narrow
        self.changes += 1
        last = self._low + self._width - 1
        self.text = (
            f"images of 16 bits have values from {low} to {high}; {self._low} to {last} are scaled "
            "to 0 to 255"
            if self._width < _ALL
            else ""
        )
