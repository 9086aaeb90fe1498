"""The camera as a user describes it, for recordings that do not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan, degrees, hypot, radians, tan
from pathlib import Path

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_info import LEAST_FOV_DEG, MOST_FOV_DEG, unusual
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.recordings.focal_length import FILM_DIAGONAL_MM, equivalent_mm

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
    #: relative standard deviation of a focal length by ``fov_deg`` that was found; None for one
    #: that a person states.
    focal_stddev: float | None = None

    @property
    def is_calibrated(self) -> bool:
        """Whether field of view or calibration is given."""
        return self.fov_deg is not None or self.calibration is not None

    @property
    def stands_rad(self) -> float:
        """Roll of the camera itself: a mirrored image of it seems to be turned the other way."""
        return (self.roll_rad or 0.0) * (-1.0 if self.is_mirrored else 1.0)

    def standing(self, roll_rad: float) -> GivenCamera:
        """Return this camera with the roll of the camera itself, unless one is given."""
        if self.roll_rad is not None or not roll_rad:
            return self
        return replace(self, roll_rad=-roll_rad if self.is_mirrored else roll_rad)

    def check(self) -> None:
        """Raise CameraError if the calibration is unreadable or the field of view impossible."""
        if self.calibration is not None:
            load_calibration(self.calibration)
        elif self.fov_deg is not None and not LEAST_FOV_DEG <= self.fov_deg <= MOST_FOV_DEG:
            raise CameraError(
                f"the field of view is {self.fov_deg:g} degrees; expected {LEAST_FOV_DEG:g} to "
                f"{MOST_FOV_DEG:g} degrees across the width of the image: {FOV_HINT}"
            )

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
        elif self.fov_deg is not None:
            found = Calibration.of_fov(width, height, self.fov_deg)
            if self.focal_stddev is not None:
                found = replace(found, focal_stddev=self.focal_stddev)
        elif file is not None:
            fov_deg, is_told = _fov_deg(file, width, height)
            found = Calibration.of_fov(width, height, fov_deg)
            if not is_told:
                found = replace(found, focal_stddev=GUESSED_STDDEV)
        else:
            raise CameraError(
                f"{path} does not tell the camera's field of view; give --fov DEG, across the "
                f"width of the image ({FOV_HINT}), or --calibration FILE of camera_calibration"
            )
        return self.rolled(replace(found, frame_id=frame_id or found.frame_id))

    def remarks(self, file: Path, width: int, height: int) -> list[str]:
        """Return what was assumed of the field of view of a film or image, or seems to be wrong."""
        if self.calibration is not None:
            given = load_calibration(self.calibration)
            found = unusual(given.k, given.width, given.height)
            return [f"{self.calibration}: {found}"] if found else []
        if self.fov_deg is None:
            fov_deg, is_told = _fov_deg(file, width, height)
            if is_told:
                return [f"the file tells the field of view: {fov_deg:.0f} degrees across"]
            return [
                f"{UNKNOWN_LENS}: {fov_deg:.0f} degrees across are "
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

    def rolled(self, calibration: Calibration) -> Calibration:
        """Return the calibration with the given roll, and mirrored if the images are."""
        return replace(calibration, roll_rad=self.roll_rad or 0.0, is_mirrored=self.is_mirrored)


def _fov_deg(file: Path, width: int, height: int) -> tuple[float, bool]:
    """Return the field of view across an image, degrees, and whether the file tells it."""
    focal_mm = equivalent_mm(file)
    if focal_mm is None:
        focal = max(width, height) / 2 / tan(radians(_GUESSED_DEG) / 2)
    else:
        focal = focal_mm / FILM_DIAGONAL_MM * hypot(width, height)
    return 2 * degrees(atan(width / 2 / focal)), focal_mm is not None
