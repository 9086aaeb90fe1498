"""The focal length that a phone writes into a film or an image: the equivalent on 35 mm film.

Images state it as EXIF ``FocalLengthIn35mmFilm``. Films have it among their QuickTime metadata, in
``meta`` of the film or of a track: names of values in ``keys``, the values in ``ilst``.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

from PIL import Image

from cardbox_tracker.camera.film_headers import boxes

FILM_DIAGONAL_MM = 43.27
"""Diagonal of the image on 35 mm film, to which the equivalent focal length belongs."""

# First bytes of JPEG and PNG.
_IMAGES = b"\xff\xd8", b"\x89PNG"
_EXIF_IFD, _EXIF_EQUIVALENT = 0x8769, 0xA405
_ENDING = b"focal_length.35mm_equivalent"
_SHORTEST_MM, _LONGEST_MM = 4.0, 2000.0
# Boxes of a film that contain boxes, and types of real numbers.
_CONTAINERS = (b"moov", b"trak", b"udta")
_REALS = {23: ">f", 24: ">d"}
_MOST_BYTES = 1024 * 1024


def equivalent_mm(path: Path) -> float | None:
    """Return the 35 mm equivalent focal length of a film or an image, mm; None if it is unknown."""
    try:
        with path.open("rb") as file:
            is_image = file.read(4).startswith(_IMAGES)
        found = _of_image(path) if is_image else _of_film(path)
    except Exception:
        # Parsers of foreign formats raise errors of any type. A damaged file says nothing; those
        # who decode it say so.
        return None
    return found if found is not None and _SHORTEST_MM <= found <= _LONGEST_MM else None


def _of_image(path: Path) -> float | None:
    with warnings.catch_warnings(action="ignore"), Image.open(path) as image:
        value = image.getexif().get_ifd(_EXIF_IFD).get(_EXIF_EQUIVALENT)
    return None if value is None else float(value)


def _of_film(path: Path) -> float | None:
    with path.open("rb") as film:
        for kind, begin, end in boxes(film, _CONTAINERS):
            if kind != b"meta":
                continue
            film.seek(begin)
            content = film.read(min(end - begin, _MOST_BYTES))
            # That of MP4 begins with version and flags, that of QuickTime does not.
            parts = dict(_parts(content[4:] if content[:4] == bytes(4) else content))
            keys = [name for _, name in _parts(parts.get(b"keys", b"")[8:])]
            for number, item in _parts(parts.get(b"ilst", b"")):
                index = int.from_bytes(number, "big") - 1
                value = dict(_parts(item)).get(b"data", b"")
                if 0 <= index < len(keys) and keys[index].endswith(_ENDING):
                    return _number(value)
    return None


def _parts(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and content of each box in a row of boxes."""
    for kind, begin, end in boxes(BytesIO(content)):
        yield kind, content[begin:end]


def _number(value: bytes) -> float | None:
    """Return the number in the content of a box ``data``: type, language, value."""
    kind, number = int.from_bytes(value[:4], "big"), value[8:]
    if kind in _REALS:
        return float(struct.unpack(_REALS[kind], number)[0])
    return float(number) if kind == 1 else float(int.from_bytes(number, "big"))
