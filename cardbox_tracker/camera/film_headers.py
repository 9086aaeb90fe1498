"""Reads from the header of a film what OpenCV does not tell."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Container, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CameraError

# More than the longest header of a film or a track.
_MOST_HEADER_BYTES = 128
_MOST_START_BYTES = 4096
_TO_CODEC = b"moov", b"trak", b"mdia", b"minf", b"stbl"
# Where the headers of a film and a track have their matrix; those of version 1 have it 12 later.
_MATRICES = {b"mvhd": 36, b"tkhd": 40}
# Boxes of a film that are read; its header is among the first or last ones of a few.
_MOST_BOXES = 10_000
MOST_DAMAGED = 100
"""Images in a row that cannot be decoded, after which a film counts as ended."""
# Pixels that are less oblong count as square, px / px.
_SQUARE = 0.01
_MOST_OBLONG = 4.0
# The starts of MPEG-1 and 2 and of program streams, which have a rate or times.
_WITH_TIMES = (b"\0\0\1\xb3", b"\0\0\1\xba")


def check_times(path: Path, remedy: str) -> None:
    """Raise CameraError, with a ``remedy``, if a film is a raw stream without times or a rate."""
    with path.open("rb") as file:
        start = file.read(5)
    code = start.removeprefix(b"\0") if start.startswith(b"\0\0\0\1") else start
    is_h26x = code.startswith(b"\0\0\1") and not code.startswith(_WITH_TIMES)
    if is_h26x or start.startswith(b"\xff\xd8\xff"):
        raise CameraError(
            f"{path} is a raw {'H.264 or H.265' if is_h26x else 'JPEG'} stream, which has neither "
            f"times nor a rate; {remedy}"
        )


def codecs(path: Path) -> str:
    """Return a remark with the codecs that an MP4, MOV, MKV or WebM names; empty if unknown."""
    with suppress(OSError, struct.error, RecursionError), path.open("rb") as file:
        names = re.findall(rb"\b[AV]_[A-Z0-9_/]+", file.read(_MOST_START_BYTES))
        for kind, at, _ in boxes(file, _TO_CODEC):
            if kind == b"stsd":
                file.seek(at + 12)
                names.append(file.read(4))
        shown = {ascii(name.decode("latin-1"))[1:-1] for name in names}
        return f" (it has the codecs {', '.join(sorted(shown)[:9])})" if shown else ""
    return ""


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


def display_matrix(path: Path, number: int) -> NDArray[np.float64]:
    """Return how an MP4 or MOV places a video track, counted from 0, on the screen, as a (2, 2).

    Pixels (column, row), as a row before the matrix, become those that are shown, but for a shift;
    other films have the identity. The matrices of track and film are multiplied, as players do.
    """
    film, track, tracks = np.eye(2), np.eye(2), []
    with suppress(OSError, struct.error, IndexError, RecursionError), path.open("rb") as file:
        for kind, at, _ in boxes(file, (b"moov", b"trak", b"mdia")):
            file.seek(at)
            header = file.read(_MOST_HEADER_BYTES)
            if kind == b"hdlr" and header[8:12] == b"vide":
                tracks.append(track)
            if kind in _MATRICES:
                place = _MATRICES[kind] + (12 if header[0] else 0)
                found = np.reshape(struct.unpack_from(">2i4x2i", header, place), (2, 2)) / 65536
                film, track = (found, track) if kind == b"mvhd" else (film, found)
    return tracks[number] @ film if number < len(tracks) else np.eye(2)


def placed_by(matrix: NDArray[np.float64], image: NDArray[Any]) -> NDArray[Any]:
    """Return an image (H, W) or (H, W, 3) turned and mirrored by a :func:`display_matrix`."""
    is_turned = abs(matrix[0, 1]) > abs(matrix[0, 0])
    across, down = (matrix[1, 0], matrix[0, 1]) if is_turned else matrix.diagonal()
    image = image.swapaxes(0, 1) if is_turned else image
    return np.ascontiguousarray(image[:: -1 if down < 0 else 1, :: -1 if across < 0 else 1])


def shown_s(path: Path) -> float | None:
    """Return how long an MP4 or MOV is shown, s, by its edit list, as after trimming, or None."""
    timescale, times = 0, [0]
    try:
        with path.open("rb") as file:
            for kind, at, _ in boxes(file, (b"moov", b"trak")):
                file.seek(at)
                header = file.read(_MOST_HEADER_BYTES)
                if kind == b"mvhd":
                    (timescale,) = struct.unpack_from(">I", header, 20 if header[0] else 12)
                elif kind == b"tkhd":
                    (width,) = struct.unpack_from(">I", header, 88 if header[0] else 76)
                    place = (">Q", 28) if header[0] else (">I", 20)
                    (duration,) = struct.unpack_from(place[0], header, place[1])
                    times.append(duration if width else 0)
    except (struct.error, IndexError, RecursionError):
        return None
    return max(times) / timescale if timescale and max(times) > 0 else None


def boxes(file: BinaryIO, inside: Container[bytes] = ()) -> Iterator[tuple[bytes, int, int]]:
    """Return kind, begin and end of the first boxes of an MP4 or MOV, and of those ``inside``."""
    return islice(_boxes(file, inside, 0, file.seek(0, os.SEEK_END)), _MOST_BOXES)


def _boxes(
    file: BinaryIO, inside: Container[bytes], start: int, end: int
) -> Iterator[tuple[bytes, int, int]]:
    while start + 8 <= end:
        file.seek(start)
        size, kind = struct.unpack(">I4s", file.read(8))
        header = 8
        if size == 1:
            size, header = struct.unpack(">Q", file.read(8))[0], 16
        size = size or end - start
        if size < header:
            return
        yield kind, start + header, min(start + size, end)
        if kind in inside:
            yield from _boxes(file, inside, start + header, min(start + size, end))
        start += size
