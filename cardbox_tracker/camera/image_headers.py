"""Reads the size of a compressed image from its header, before memory is allocated.

An image of a few kB can decode to gigabytes. ROS sends JPEG and PNG; other formats that OpenCV
could decode are refused, so that their decoders cannot be reached.
"""

from __future__ import annotations

import struct

from cardbox_tracker.common.errors import EncodingError, quoted

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8"
# Start of frame: C0 to CF without the tables C4 and CC and the reserved C8.
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_WITHOUT_LENGTH = frozenset((0x01, *range(0xD0, 0xD9)))
_ENDS = (0xD9, 0xDA)


def compressed_size(data: bytes, kind: str = "") -> tuple[int, int]:
    """Return width and height, px, of a JPEG or PNG image by its header, or raise EncodingError.

    ``kind`` is the format that its message states.
    """
    size = None
    if data.startswith(_PNG):
        size = _png_size(data)
    elif data.startswith(_JPEG):
        size = _jpeg_size(data)
    if size is None or min(size) < 1:
        form = f", of the format {quoted(kind)}" if kind else ""
        raise EncodingError(
            f"the compressed image ({len(data)} bytes{form}) cannot be decoded; expected whole "
            "JPEG or PNG data: check the camera's transport; 'ros2 run image_transport republish' "
            "makes such images of others"
        )
    return size


def check_pixels(width: int, height: int, most_pixels: float) -> None:
    """Raise EncodingError if an image has more than ``most_pixels``."""
    if width * height > most_pixels:
        raise EncodingError(
            f"an image of {width}x{height} is larger than the {most_pixels / 1e6:.3g} million "
            "pixels that are allowed; send smaller images"
        )


def _png_size(data: bytes) -> tuple[int, int] | None:
    if len(data) < 24 or data[12:16] != b"IHDR":
        return None
    width, height = struct.unpack(">II", data[16:24])
    return width, height


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return the size in the frame header, found marker by marker."""
    at = 2
    while True:
        at = data.find(b"\xff", at)
        if at < 0 or at + 9 > len(data):
            return None
        marker = data[at + 1]
        if marker == 0xFF:  # padding
            at += 1
        elif marker == 0 or marker in _WITHOUT_LENGTH:
            at += 2
        elif marker in _ENDS:
            return None
        elif marker in _FRAMES:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        else:
            (length,) = struct.unpack(">H", data[at + 2 : at + 4])
            at += 2 + max(length, 2)
