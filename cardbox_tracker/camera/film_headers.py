"""Reads from the header of a film what OpenCV does not tell."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CameraError

_MOST_HEADER_BYTES = 64 * 1024 * 1024
# Pixels that are less oblong count as square, px / px.
_SQUARE = 0.01
_MOST_OBLONG = 4.0
# The starts of MPEG-1 and 2 and of program streams, which have a rate or times.
_WITH_TIMES = (b"\0\0\1\xb3", b"\0\0\1\xba")


def check_times(path: Path, remedy: str) -> None:
    """Check that a film is no raw stream, which has neither times nor a rate.

    Args:
        path: the film.
        remedy: how its rate can be given, for the text.

    Raises:
        CameraError: it is such a stream.
    """
    with path.open("rb") as file:
        start = file.read(5)
    code = start.removeprefix(b"\0") if start.startswith(b"\0\0\0\1") else start
    is_h26x = code.startswith(b"\0\0\1") and not code.startswith(_WITH_TIMES)
    if is_h26x or start.startswith(b"\xff\xd8\xff"):
        raise CameraError(
            f"{path} is a raw {'H.264 or H.265' if is_h26x else 'JPEG'} stream, which has neither "
            f"times nor a rate; {remedy}"
        )


def oblong(capture: cv2.VideoCapture) -> float:
    """Return the width of the pixels of an open film relative to their height, as it is shown."""
    across, down = capture.get(cv2.CAP_PROP_SAR_NUM), capture.get(cv2.CAP_PROP_SAR_DEN)
    shape = across / down if across > 0 < down else 1.0
    if not 1 / _MOST_OBLONG < shape < _MOST_OBLONG or abs(shape - 1) < _SQUARE:
        return 1.0
    is_turned = int(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 180 != 0
    return 1 / shape if is_turned else shape


def with_square_pixels(image: NDArray[Any], shape: float) -> NDArray[np.uint8]:
    """Return an image (H, W) or (H, W, 3) stretched so that pixels of :func:`oblong` are square."""
    if shape != 1.0:
        height, width = image.shape[:2]
        size = round(width * max(shape, 1.0)), round(height * max(1 / shape, 1.0))
        image = cv2.resize(image, size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(image, np.uint8)


def shown_s(path: Path) -> float | None:
    """Return for how long the images of an MP4 or MOV are shown, seconds, as its edit list says.

    Films that were trimmed on a phone keep the images before and after. It is None for other
    films, and for those that do not state it.
    """
    with path.open("rb") as file:
        header = _movie_header(file)
    at = header.find(b"mvhd") + 4
    if at < 4:
        return None
    try:
        (timescale,) = struct.unpack_from(">I", header, at + (20 if header[at] else 12))
        times = list(_shown_times(header))
    except (struct.error, IndexError):
        return None
    return max(times) / timescale if timescale and times and max(times) > 0 else None


def _movie_header(file: BinaryIO) -> bytes:
    """Return the box ``moov`` of a film; empty if there is none."""
    size = os.fstat(file.fileno()).st_size
    at = 0
    while at + 16 <= size:
        file.seek(at)
        length, kind, long = struct.unpack(">I4sQ", file.read(16))
        length = long if length == 1 else length or size - at
        if length < 8 or (at == 0 and kind not in (b"ftyp", b"moov", b"wide", b"mdat", b"free")):
            return b""
        if kind == b"moov":
            file.seek(at)
            return file.read(min(length, _MOST_HEADER_BYTES))
        at += length
    return b""


def _shown_times(header: bytes) -> Iterator[int]:
    """Yield the duration of each track that has a width, in units of the film."""
    at = header.find(b"tkhd")
    while at >= 0:
        is_long = header[at + 4]
        (width,) = struct.unpack_from(">I", header, at + 4 + (88 if is_long else 76))
        place = at + 4 + (28 if is_long else 20)
        (duration,) = struct.unpack_from(">Q" if is_long else ">I", header, place)
        if width:
            yield duration
        at = header.find(b"tkhd", at + 4)
