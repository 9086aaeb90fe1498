"""Points of people that another program has found in the images of a recording."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError, cut, quoted, reason_of
from cardbox_tracker.common.files import UnreadableFileError, foreign, table_rows
from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_INDEX,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.detectors.keypoint_json import (
    coco_people,
    image_numbers,
    openpose_people,
    plain_name,
)
from cardbox_tracker.detectors.person_choice import LEAST_INSIDE, inside, near_person, person_in
from cardbox_tracker.detectors.point_checks import (
    Size,
    check_person,
    check_point,
    count_person,
    person_of,
)
from cardbox_tracker.person.sizes import FloatArray

COLUMNS = ("stamp_ns", "joint", "u", "v", "score")
"""Columns that a table needs; ``frame`` may take the place of the first."""
SPACE = ("x", "y", "z")
"""Columns of points in space, as in ``ImagePoints.spatial_m``, which a table may have."""
FRAME, _PERSON = "frame", "person"
_USED = frozenset((*POINT_INDEX, *LEG_POINT_NAMES))
# Columns of the image's stamp with their units, ns.
_STAMPS = {"stamp_ns": 1, "stamp_us": 10**3, "stamp_ms": 10**6, "stamp_s": 10**9, "stamp": 10**9}
_MOST_NS = 2**63
# An hour of all points at 30 Hz has 100 MB.
_MOST_BYTES = 256 * 1024 * 1024
# float32 rounds a score of 1 by less.
_ROUNDED = 1.001
# Points of which less is in the silhouette are compared with others, of which as much must be.
_MOST_DOUBTFUL, _LEAST_SURE = 0.6, 0.85
# Images with wrong points, after which points are used only while most are right.
_MANY = 10
# A recording's length is stated inexactly.
_SPAN_NS = 1_000_000_000

Key = int | str
"""Stamp (ns), number or name of an image."""
Persons = dict[Key, list[ImagePoints]]
"""The people in each image."""


class PointTable(NamedTuple):
    """Points in a CSV table with a row for each point, or in JSON files.

    Columns are ``stamp_ns`` of the image, or ``stamp_us``, ``stamp_ms``, ``stamp_s``, or ``stamp``
    in seconds, or ``frame``, the image's number from 0 on; ``joint``, one of
    ``POINT_NAMES`` (others are not used); ``u`` and ``v``, column and row in the camera's own
    image, px; and ``score``, 0 to 1. With several people, ``person`` tells them apart. A recording
    of several cameras also needs ``camera``, the camera's namespace. For JSON see
    :mod:`.keypoint_json`; there, each camera has a folder or file of its name.
    """

    path: Path  #: the table, a file of COCO, or a folder of OpenPose's files
    people: int = 0  #: 0 for the person in the silhouette, more for all people

    def read(self, camera: str | None, size: Size | None = None) -> GivenPoints:
        """Return the points of one camera, px of its own image, or of the only one.

        Without the ``size`` of the image any place will do. Raises CardboxError if a file cannot be
        read, lacks a column, or has an impossible point.
        """
        path = self.path
        if path.suffix == ".json" or path.is_dir():
            path = path if camera is None else path / camera
            with foreign(path, CardboxError, "JSON of OpenPose or COCO"):
                return self._read_json(path, size)
        with foreign(
            path, CardboxError, f"a CSV file in UTF-8 with the columns {', '.join(COLUMNS)}"
        ):
            kind, persons, most = self._read_table(camera, size)
            return GivenPoints(path, kind, persons, most_score=most)

    def _read_json(self, path: Path, size: Size | None) -> GivenPoints:
        if not path.is_dir() and path.suffix != ".json":
            path = path.with_name(f"{path.name}.json")
        persons: Persons = {}
        most = 0.0
        for found in openpose_people(path) if path.is_dir() else coco_people(path):
            try:
                person = person_of(found.points, size)
            except CardboxError as error:
                raise CardboxError(f"{found.place}: {error}") from None
            if not found.points:
                continue
            most = max(most, *(point[3] for point in found.points))
            persons.setdefault(found.image, []).append(person)
        if not persons:
            raise CardboxError(f"{path} has no point of anybody; give what a detector has found")
        is_named = any(isinstance(key, str) for key in persons)
        return GivenPoints(path, "name" if is_named else FRAME, persons, most_score=most)

    def _read_table(self, camera: str | None, size: Size | None) -> tuple[str, Persons, float]:
        most, names = 0.0, dict[str, None]()
        found: dict[tuple[Key, str], dict[str, list[float]]] = {}
        first_lines: dict[tuple[Key, str], int] = {}
        counts = Counter[str]()
        try:
            with table_rows(self.path, _MOST_BYTES) as rows:
                column = self._check(rows.fieldnames or (), camera)
                kind = FRAME if column == FRAME else COLUMNS[0]
                space = SPACE if set(SPACE) <= set(rows.fieldnames or ()) else ()
                for row in rows:
                    if camera is not None and row["camera"] != camera:
                        continue
                    image, joint = _image_of(row[column], column), plain_name(row["joint"] or "")
                    names.setdefault(joint)
                    # A cell that is empty is missing, as in tables of pandas.
                    u, v, score = (
                        float("nan" if row[name] == "" else row[name]) for name in COLUMNS[2:]
                    )
                    if row["score"] == row["u"] == row["v"] == "":
                        score = 0.0
                    check_point((joint, u, v, score), size)
                    most = max(most, score)
                    key: tuple[Key, str] = image, row.get(_PERSON) or ""
                    if key not in found:
                        count_person(counts, image)
                    joints = found.setdefault(key, {})
                    first_lines.setdefault(key, rows.line_num)
                    if joint in joints:
                        raise CardboxError(
                            f"{kind} {image} has {cut(joint)} again; with several people, give a "
                            f"column {_PERSON}"
                        )
                    if score > 0.0 and joint in _USED:
                        joints[joint] = [u, v, score, *(float(row[x] or "nan") for x in space)]
        except (UnreadableFileError, UnicodeDecodeError, _TableError):
            raise
        except (ValueError, TypeError, ArithmeticError) as error:
            raise CardboxError(
                f"{self.path}, line {rows.line_num}, has a value that is no number "
                f"({reason_of(error)}); expected numbers in {column}, u, v and score"
            ) from None
        except CardboxError as error:
            raise CardboxError(f"{self.path}, line {rows.line_num}: {error}") from None
        if names and not _USED & names.keys():
            raise CardboxError(
                f"{self.path} names its points {quoted(', '.join(names))}; expected names such as "
                "left_shoulder in the column joint"
            )
        persons: Persons = {}
        for key, joints in found.items():
            try:
                check_person(joints)
            except CardboxError as error:
                raise CardboxError(f"{self.path}, line {first_lines[key]}: {error}") from None
            persons.setdefault(key[0], []).append(ImagePoints.of(joints))
        return kind, persons, most

    def _check(self, names: Sequence[str], camera: str | None) -> str:
        kind = next((name for name in (*_STAMPS, FRAME) if name in names), COLUMNS[0])
        expected = kind, *COLUMNS[1:], *(() if camera is None else ("camera",))
        missing = [name for name in expected if name not in names]
        if missing:
            raise _TableError(
                f"{self.path} has no column {', '.join(missing)}; a table of points has the "
                f"columns {', '.join(expected)}, separated by commas or semicolons; {FRAME}, the "
                f"image's number from 0 on, or {', '.join(list(_STAMPS)[1:])} may take the place "
                f"of {COLUMNS[0]}"
            )
        return kind


def _image_of(text: str, column: str) -> int:
    """Return the number of an image, or its stamp in ns; ValueError or ArithmeticError if none."""
    if column == FRAME:
        return int(text)
    stamp_ns = Decimal(text) * _STAMPS[column]
    is_whole = column != COLUMNS[0] or stamp_ns % 1 == 0
    if not (abs(stamp_ns) < _MOST_NS and is_whole):
        raise ValueError(f"{column} is {text}")
    return round(stamp_ns)


class _TableError(CardboxError):
    """The table lacks a column, which is the fault of no line."""


class Image(NamedTuple):
    """An image to which points may belong: its stamp (ns), number from 0 on, and file name."""

    stamp_ns: int
    number: int = -1
    name: str = ""

    def key(self, kind: str) -> Key:
        """Return by what points name the image."""
        if kind == FRAME:
            return self.number
        return (self.name or self.number) if kind == "name" else self.stamp_ns


class GivenPoints:
    """The points of one camera, which join its images.

    Points with stamps join the image whose stamp is nearest, within a tolerance, others that of
    their number or name. Points that lie beside the person's silhouette are not used.

    Attributes:
        kind: what the points say of their image: ``stamp_ns``, ``frame`` or ``name``.
        images: number of images for which points were asked.
        used: number of images whose points were used.
        beside: number of images whose points lie beside the silhouette.
    """

    def __init__(
        self,
        path: Path,
        kind: str,
        persons: Persons,
        tolerance_ns: int = 0,
        most_score: float = 0.0,
    ) -> None:
        self._most_score = most_score
        self._path, self.kind, self._persons, self._tolerance_ns = path, kind, persons, tolerance_ns
        self._stamps = sorted(key for key in persons if isinstance(key, int))
        self._numbered: dict[int, list[ImagePoints]] = {}
        if kind == "name":
            # A video's images have no names, but programs number those that they take out of it.
            numbers = image_numbers(key for key in persons if isinstance(key, str))
            self._numbered = {number: persons[name] for name, number in numbers.items()}
        self._is_by_number = False
        self.restart()

    def restart(self) -> None:
        """Count anew."""
        self.images = self.used = self.beside = self._joined = self._lying = 0
        self._reasons = Counter[str]()
        self._ends: list[Image] = []

    def placed(self, calibration: Calibration, size: Size, tolerance_ns: int) -> GivenPoints:
        """Return the points undistorted and at the working ``size``, see :func:`placed`."""
        persons = {
            key: [placed(person, calibration, size) for person in there]
            for key, there in self._persons.items()
        }
        return GivenPoints(self._path, self.kind, persons, tolerance_ns, self._most_score)

    def persons(self, image: Image, tolerance_ns: int) -> list[ImagePoints]:
        """Return the people in an image; none if no points join it."""
        if self.kind == COLUMNS[0]:
            return self._persons.get(self._nearest(image.stamp_ns, tolerance_ns), [])
        self._is_by_number = self.kind == FRAME or (self.kind == "name" and not image.name)
        if self.kind == "name" and not image.name:
            return self._numbered.get(image.number, [])
        return self._persons.get(image.key(self.kind), [])

    def _nearest(self, at_ns: int, tolerance_ns: int) -> int:
        number = bisect_left(self._stamps, at_ns)
        around = self._stamps[max(number - 1, 0) : number + 1]
        nearest = min(around, key=lambda stamp_ns: abs(stamp_ns - at_ns), default=-1)
        return nearest if abs(nearest - at_ns) <= tolerance_ns else -1

    def at(self, image: Image, silhouette: NDArray[np.uint8]) -> ImagePoints | None:
        """Return the points of the person in the silhouette (H, W) of an image, if it has any."""
        self.images += 1
        self._ends = [*self._ends[:1], image]
        found = self.persons(image, self._tolerance_ns)
        self._joined += bool(found)
        person = person_in(silhouette, found)
        if person is None:
            return None
        reason = why_not(silhouette, person)
        self._reasons[reason] += 1
        wrong = self._reasons.total() - self._reasons[""]
        # Wrong points are on the person by chance in some images.
        if reason or wrong > max(_MANY, self._reasons[""]):
            self.beside += 1
            return None
        self.used += 1
        self._lying += _lies(person)
        return person

    def all_in(self, image: Image) -> list[ImagePoints]:
        """Return the points of all people in an image."""
        self.images += 1
        self._ends = [*self._ends[:1], image]
        found = self.persons(image, self._tolerance_ns)
        self._joined += bool(found)
        self.used += bool(found)
        self._lying += bool(found) and all(map(_lies, found))
        return found

    @property
    def fault(self) -> str:
        """Why no image has points that could be used; empty if one has."""
        if self.used or not self.images:
            return ""
        if not self._joined:
            return self._apart(self._ends[0], self._ends[-1])
        if not self.beside:
            return f"the points of {self._path} have the score 0 in all images: nobody is there"
        return f"the points of {self._path} are used in 0 of {self.images} images: {self._why}"

    def check_span(self, first_ns: int, last_ns: int) -> None:
        """Raise CardboxError unless a stamp lies between those of the first and last image."""
        margin_ns = _SPAN_NS + (last_ns - first_ns) // 10
        number = bisect_left(self._stamps, first_ns - margin_ns)
        is_apart = number == len(self._stamps) or self._stamps[number] > last_ns + margin_ns
        if self.kind == COLUMNS[0] and is_apart:
            raise CardboxError(self._apart(Image(first_ns), Image(last_ns)))

    def _apart(self, first: Image, last: Image) -> str:
        """Return that no points fit the images from ``first`` to ``last``."""
        there = sorted(self._persons, key=str if self.kind == "name" else int) or ["none"]
        images = f"{quoted(first.key(self.kind))} to {quoted(last.key(self.kind))}"
        return (
            f"0 of {len(self._persons)} points of {self._path} fit an image: their {self.kind} is "
            f"{quoted(there[0])} to {quoted(there[-1])}, that of the images {images}; expected "
            f"{_EXPECTED[self.kind]}"
        )

    @property
    def remark(self) -> str:
        """Warnings about places and scores of points; empty if all is well."""
        found = []
        if self.beside:
            found.append(
                f"the points of {self.beside} of {self.images} images are not used: {self._why}"
            )
        elif 2 * self._lying > self.used:
            found.append(
                f"the points of {self._lying} of {self.used} images are of people who lie; if they "
                "do not, columns and rows are exchanged: expected u, v"
            )
        if self._is_by_number and min(self._numbered or self._stamps, default=0) == 1:
            found.append(
                f"the images of {self._path} are numbered from 1 on; expected 0 for the first one: "
                "if 1 is the first one, all points are an image late, so subtract 1"
            )
        if self._most_score > _ROUNDED:
            found.append(
                f"scores of {self._path} reach {self._most_score:g}; those above 1 count as 1"
            )
        return ", and ".join(found)

    @property
    def _why(self) -> str:
        return max(filter(None, self._reasons), key=lambda reason: self._reasons[reason])


_BESIDE = (
    "they lie beside the person's silhouette; expected pixels of this camera's own images, at "
    "their full size, and the person who is tracked"
)
_EXCHANGED = (
    "they lie on the person when columns and rows are exchanged; expected u, v: the column, then "
    "the row"
)
_MIRRORED = (
    "they lie on the person only when they are mirrored; give --mirrored if the film is a mirrored "
    "one, or points of these very images"
)
_EXPECTED = {
    COLUMNS[0]: "the stamp of an image, within half the time between images",
    FRAME: "the number of an image, counted from 0",
    "name": "the name of a file in a folder of images",
}


def why_not(silhouette: NDArray[np.uint8], person: ImagePoints) -> str:
    """Return why points are not those of a person in a silhouette (H, W); empty if they may be."""
    near = near_person(silhouette)
    if near is None or person.is_empty:
        return ""
    share, exchanged = inside(near, person), ImagePoints(person.px[:, ::-1], person.scores)
    is_tall = near.any(axis=1).sum() > near.any(axis=0).sum()
    if is_tall and _lies(person) and inside(near, exchanged) >= share:
        return _EXCHANGED
    if share >= _MOST_DOUBTFUL:
        return ""
    mirrored = np.stack([silhouette.shape[1] - 1 - person.px[:, 0], person.px[:, 1]], axis=1)
    others = {_EXCHANGED: person.px[:, ::-1], _MIRRORED: mirrored}
    shares = {reason: inside(near, ImagePoints(px, person.scores)) for reason, px in others.items()}
    best = max(shares, key=lambda reason: shares[reason])
    if shares[best] >= _LEAST_SURE:
        return best
    return _BESIDE if share < LEAST_INSIDE else ""


def _lies(person: ImagePoints) -> bool:
    """Return whether the trunk is rather level than upright in the image."""
    shoulders, hips = (
        person.px[[POINT_INDEX[f"{side}_{joint}"] for side in ("left", "right")]].mean(axis=0)
        for joint in ("shoulder", "hip")
    )
    across_px, down_px = np.abs(hips - shoulders).tolist()
    return bool(across_px > down_px)


def placed(person: ImagePoints, calibration: Calibration, size: Size) -> ImagePoints:
    """Return points of a camera's own image undistorted and at the working ``size``."""

    def moved(
        px: FloatArray, scores: FloatArray, spatial_m: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        px = calibration.rectified(px, *size)
        if calibration.is_distorted:
            # Beyond its image, a lens is not calibrated.
            is_near = ((px > -np.array(size)) & (px < 2 * np.array(size))).all(axis=1)
            scores = np.where(is_near, scores, 0.0)
        return px, scores, None if spatial_m is None else spatial_m @ calibration.turn().T

    px, scores, spatial_m = moved(person.px, person.scores, person.spatial_m)
    legs = None if person.legs is None else LegPoints(*moved(*person.legs))
    found = replace(person, px=px, scores=scores, spatial_m=spatial_m, legs=legs)
    # In a mirrored image, a detector takes the left side for the right one.
    return found.exchanged() if calibration.is_mirrored else found
