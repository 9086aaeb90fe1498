"""The camera as a user describes it, or a phone by the focal length in its files.

Images state it as EXIF ``FocalLengthIn35mmFilm``, or in millimetres beside the size of the sensor;
films in QuickTime's ``meta``: names in ``keys``, values in ``ilst``.
"""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from math import atan, degrees, hypot, radians, sin, tan
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import GIVEN_FIELD_OF_VIEW, Calibration
from cardbox_tracker.camera.camera_info import LEAST_FOV_DEG, MOST_FOV_DEG, unusual
from cardbox_tracker.camera.film_headers import boxes
from cardbox_tracker.camera.known_lenses import NAMED_STDDEV, sensor_width_mm, webcam_fov_deg
from cardbox_tracker.common.errors import CameraError

FILM_DIAGONAL_MM = 43.27
"""Diagonal of the image on 35 mm film, to which the equivalent focal length belongs."""

# First bytes of JPEG and PNG.
_IMAGES = b"\xff\xd8", b"\x89PNG"
_EXIF_IFD, _EXIF_EQUIVALENT, _EXIF_MODEL, _EXIF_MM = 0x8769, 0xA405, 0x0110, 0x920A
# Pixels to a length of the sensor, number of its unit, size of the image; units and sensors, mm.
_EXIF_DENSITY, _EXIF_UNIT, _EXIF_WIDTH, _EXIF_HEIGHT = 0xA20E, 0xA210, 0xA002, 0xA003
_UNITS_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
_NARROWEST_MM, _WIDEST_MM = 2.0, 60.0
_ENDING = b"focal_length.35mm_equivalent"
_SHORTEST_MM, _LONGEST_MM = 4.0, 2000.0
# Boxes of a film that contain boxes, and types of real numbers.
_CONTAINERS = (b"moov", b"trak", b"udta")
_REALS = {23: ">f", 24: ">d"}
_MOST_BYTES = 1024 * 1024
_BY_FILE = "the file"


class LensCue(NamedTuple):
    """What tells a focal length."""

    focal: float  #: a 35 mm equivalent focal length, mm, or a field of view across, degrees
    stddev: float  #: relative standard deviation of the focal length
    by: str  #: what tells it, in words; empty if a person or nothing does


def told_focal(path: Path) -> LensCue | None:
    """Return the 35 mm equivalent focal length that a film or an image tells, mm; None without."""
    try:
        with path.open("rb") as file:
            is_image = file.read(4).startswith(_IMAGES)
        found = _of_image(path) if is_image else _of_film(path)
    except Exception:
        # Parsers of foreign formats raise errors of any type. A damaged file says nothing; those
        # who decode it say so.
        return None
    return found if found is not None and _SHORTEST_MM <= found.focal <= _LONGEST_MM else None


def _of_image(path: Path) -> LensCue | None:
    with warnings.catch_warnings(action="ignore"), Image.open(path) as image:
        exif, size = image.getexif(), image.size
    more = exif.get_ifd(_EXIF_IFD)
    if (value := more.get(_EXIF_EQUIVALENT)) is not None:
        return LensCue(float(value), GIVEN_FIELD_OF_VIEW, _BY_FILE)
    model = str(exif.get(_EXIF_MODEL, ""))
    width_mm, by = sensor_width_mm(model), f"the focal length in the file of an {model}"
    if width_mm is None:
        width_mm, by = _sensor_mm(more, max(size)), "the file with focal length and sensor"
    diagonal_mm = width_mm * hypot(*size) / max(size)
    return LensCue(float(more[_EXIF_MM]) * FILM_DIAGONAL_MM / diagonal_mm, NAMED_STDDEV, by)


def _sensor_mm(exif: Mapping[int, Any], width: int) -> float:
    """Return the length of the longer side of a sensor, mm, of an image as long, px."""
    there = max(float(exif.get(_EXIF_WIDTH, 0)), float(exif.get(_EXIF_HEIGHT, 0))) or width
    length_mm = there / float(exif[_EXIF_DENSITY]) * _UNITS_MM[exif.get(_EXIF_UNIT, 2)]
    if not _NARROWEST_MM < length_mm < _WIDEST_MM:
        raise ValueError
    return length_mm


def _of_film(path: Path) -> LensCue | None:
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
                    focal_mm = _number(value)
                    return LensCue(focal_mm, GIVEN_FIELD_OF_VIEW, _BY_FILE) if focal_mm else None
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


UNKNOWN_LENS = "nothing tells the camera's field of view"
"""How a remark on an unknown field of view begins."""
# No usual phone held upright has so large a field of view across its image, degrees.
_UPRIGHT_DEG = 55.0
FOV_HINT = "webcams 60 to 78, phones 60 to 75 held sideways, 36 to 46 upright"
"""Usual fields of view across the width of an image, degrees, for texts."""
# Field of view along the longer side that is assumed where nothing tells it, degrees.
_GUESSED_DEG = 65.0
GUESSED_STDDEV = 0.2
"""Relative standard deviation of the focal length of such a guess."""


@dataclass(frozen=True)
class GivenCamera:
    """Properties of one camera; None for those that are not given."""

    #: field of view across the width of the image as it is shown, degrees.
    fov_deg: float | None = None
    calibration: Path | None = None  #: file of camera_calibration, in place of the field of view
    #: how far the camera is turned clockwise about its axis, seen from behind it; the images are
    #: turned back.
    roll_rad: float | None = None
    fps: float | None = None  #: images a second, in place of the rate that the recording states
    is_mirrored: bool = False  #: whether the images are mirrored; they are turned back
    webcam: str | None = None  #: name of a usual webcam, in place of the field of view
    #: relative standard deviation of a focal length by ``fov_deg`` that was found; None for one
    #: that a person states.
    focal_stddev: float | None = None

    @property
    def is_calibrated(self) -> bool:
        """Whether field of view, calibration or webcam is given."""
        return (self.fov_deg, self.calibration, self.webcam) != (None, None, None)

    @property
    def stands_rad(self) -> float:
        """Roll of the camera itself: a mirrored image of it seems to be turned the other way."""
        return (self.roll_rad or 0.0) * (-1.0 if self.is_mirrored else 1.0)

    def standing(self, roll_rad: float) -> GivenCamera:
        """Return this camera with the roll of the camera itself, unless one is given."""
        if self.roll_rad is not None or not roll_rad:
            return self
        return replace(self, roll_rad=-roll_rad if self.is_mirrored else roll_rad)

    def seeing(self, fov_rad: float, stddev_rad: float) -> GivenCamera:
        """Return this camera with a field of view across the image that was found."""
        # The focal length goes with the cotangent of half of it.
        return replace(self, fov_deg=degrees(fov_rad), focal_stddev=stddev_rad / sin(fov_rad))

    def check(self) -> None:
        """Raise CameraError if the calibration is unreadable or the field of view impossible."""
        if self.calibration is not None:
            load_calibration(self.calibration)
        elif self.fov_deg is not None and not LEAST_FOV_DEG <= self.fov_deg <= MOST_FOV_DEG:
            raise CameraError(
                f"the field of view is {self.fov_deg:g} degrees; expected {LEAST_FOV_DEG:g} to "
                f"{MOST_FOV_DEG:g} degrees across the width of the image: {FOV_HINT}"
            )
        elif self.webcam is not None:
            webcam_fov_deg(self.webcam, 16, 9)

    def calibrated(
        self,
        path: Path,
        width: int,
        height: int,
        frame_id: str = "",
        stored: tuple[int, int] = (0, 0),
        file: Path | None = None,
    ) -> Calibration:
        """Return the calibration of images of ``width`` x ``height`` px in the recording ``path``.

        ``stored`` is their size, px, before pixels were made square, of which a calibration file
        may be. If nothing is given, ``file``, a film or image, may tell the field of view, else a
        usual one is assumed; without ``file``, or if what is given does not fit, CameraError is
        raised.
        """
        if self.calibration is not None:
            found = load_calibration(self.calibration)
            if stored != (width, height) and found.has_shape(*stored):
                found = found.stretched(width / stored[0], height / stored[1])
            found.check_shape(width, height, str(path), str(self.calibration))
            found = replace(found, told_by=f"the calibration {self.calibration.name}")
        else:
            cue = self._cue(file, width, height)
            if cue is None:
                raise CameraError(
                    f"{path} does not tell the camera's field of view; give --fov DEG, across the "
                    f"width of the image ({FOV_HINT}), or --calibration FILE of camera_calibration"
                )
            found = Calibration.of_fov(width, height, cue.focal)
            found = replace(found, focal_stddev=cue.stddev, told_by=cue.by)
        return self.rolled(replace(found, frame_id=frame_id or found.frame_id))

    def remarks(self, file: Path, width: int, height: int) -> list[str]:
        """Return what was assumed of the field of view of a film or image, or seems to be wrong."""
        if self.calibration is not None:
            given = load_calibration(self.calibration)
            found = unusual(given.k, given.width, given.height)
            return [f"{self.calibration}: {found}"] if found else []
        if self.fov_deg is None:
            cue = self._cue(file, width, height)
            assert cue is not None
            if cue.by:
                return [f"{cue.by} tells the field of view: {cue.focal:.0f} degrees across"]
            return [
                f"{UNKNOWN_LENS}: {cue.focal:.0f} degrees across are "
                "assumed, so distances and sizes may be wrong by a sixth; give --fov DEG "
                f"({FOV_HINT})"
            ]
        if height <= width or self.fov_deg < _UPRIGHT_DEG:
            return []
        tall_deg = 2 * degrees(atan(tan(radians(self.fov_deg) / 2) * height / width))
        return [
            f"--fov {self.fov_deg:g} is across the width of these upright images, which makes "
            f"{tall_deg:.0f} degrees from top to bottom; a phone has 60 to 75 there, for which "
            "--fov is 36 to 46"
        ]

    def _cue(self, file: Path | None, width: int, height: int) -> LensCue | None:
        """Return what tells the field of view of images of that size, px; None if nothing does."""
        if self.fov_deg is not None:
            stddev = GIVEN_FIELD_OF_VIEW if self.focal_stddev is None else self.focal_stddev
            return LensCue(self.fov_deg, stddev, "")
        if self.webcam is not None:
            fov_deg = webcam_fov_deg(self.webcam, width, height)
            return LensCue(fov_deg, NAMED_STDDEV, f"the webcam {self.webcam}")
        if file is None:
            return None
        told = told_focal(file)
        if told is None:
            focal = max(width, height) / 2 / tan(radians(_GUESSED_DEG) / 2)
            told = LensCue(focal, GUESSED_STDDEV, "")
        else:
            focal = told.focal / FILM_DIAGONAL_MM * hypot(width, height)
        return told._replace(focal=2 * degrees(atan(width / 2 / focal)))

    def rolled(self, calibration: Calibration) -> Calibration:
        """Return the calibration with the given roll, and mirrored if the images are."""
        return replace(calibration, roll_rad=self.roll_rad or 0.0, is_mirrored=self.is_mirrored)
