"""Points of people in the JSON files of other programs: OpenPose's, and COCO's.

OpenPose writes a file for each image, whose name ends in the image's number from 0 on; so do
Sports2D and Pose2Sim. A file of COCO has a list of results, or annotations with images.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.detectors.image_points import COCO_NAMES
from cardbox_tracker.detectors.point_checks import NamedPoint

_MOST_BYTES, _MOST_OF_IMAGE = 256 * 1024 * 1024, 16 * 1024 * 1024
# Some ten hours of one person.
_MOST_PARTS = 4_000_000
_HAND_POINTS, _INDEX, _LITTLE_FINGER = 21, 5, 17
# A point that COCO's annotators saw, and one that they guessed.
_VISIBLE, _GUESSED = 2, 1


def _others(count: int) -> tuple[str, ...]:
    """Return names of points that are not used."""
    return tuple(f"point {number}" for number in range(count))


def _hand(side: str) -> tuple[str, ...]:
    names = [f"{side} hand {number}" for number in range(_HAND_POINTS)]
    names[_INDEX], names[_LITTLE_FINGER] = f"{side}_index", f"{side}_little_finger"
    return tuple(names)


_UPPER = (
    *("nose", "neck", "right_shoulder", "right_elbow", "right_wrist"),
    *("left_shoulder", "left_elbow", "left_wrist"),
)
_LEGS = tuple(f"{side}_{name}" for side in ("right", "left") for name in ("hip", "knee", "ankle"))
_SIDES = "left", "right"
# Big toe, small toe and heel of each foot.
_FEET = [name for side in _SIDES for name in (f"{side}_foot", f"{side} small toe", f"{side}_heel")]
_BODY_25B = (*COCO_NAMES, *_others(2), *_FEET)
_FACE = ("right_eye", "left_eye", "right_ear", "left_ear")
LAYOUTS: dict[int, tuple[str, ...]] = {
    17: COCO_NAMES,
    18: (*_UPPER, *_LEGS, *_FACE),
    25: (*_UPPER, "hips", *_LEGS, *_FACE, *_FEET),
    26: (*COCO_NAMES, *_others(3), *_FEET[::3], *_FEET[1::3], *_FEET[2::3]),
    133: (*COCO_NAMES, *_FEET, *_others(68), *_hand("left"), *_hand("right")),
}
"""Names of a person's points by their number: COCO, OpenPose's COCO and BODY_25, Halpe, and
COCO-WholeBody."""


class FoundPerson(NamedTuple):
    """The points of one person in one image."""

    image: int | str  #: number of the image, counted from 0, or its name
    points: list[NamedPoint]  #: the points
    place: str  #: where they stand, for errors


def openpose_people(folder: Path) -> Iterator[FoundPerson]:
    """Yield the people in a folder of OpenPose's files; raise CardboxError if there are none."""
    files = sorted(folder.glob("*.json"))
    if not files:
        raise CardboxError(
            f"{folder} has no JSON files; expected those of OpenPose, one for each image, such as "
            "film_000000000012_keypoints.json"
        )
    for file in files:
        numbers = re.findall(r"\d+", file.stem)
        if not numbers:
            raise CardboxError(
                f"the name of {file} has no number; expected that of the image, counted from 0, "
                "such as film_000000000012_keypoints.json"
            )
        content = _content(file, _MOST_OF_IMAGE)
        people = content.get("people") if isinstance(content, dict) else None
        if not isinstance(people, list):
            raise CardboxError(f"{file} has no list 'people'; expected a file of OpenPose")
        for number, person in enumerate(people):
            place = f"{file}, person {number}"
            points = _named(_value(person, "pose_keypoints_2d", place), place)
            for side in ("left", "right"):
                hand = person.get(f"hand_{side}_keypoints_2d")
                if hand:
                    points += _named(hand, place, {_HAND_POINTS: _hand(side)})
            yield FoundPerson(int(numbers[-1]), points, place)


def coco_people(file: Path) -> Iterator[FoundPerson]:
    """Yield the people in a file of COCO; raise CardboxError if it cannot be read, or is none."""
    content = _content(file, _MOST_BYTES)
    is_annotated = isinstance(content, dict)
    found = content.get("annotations") if is_annotated else content
    if not isinstance(found, list):
        raise CardboxError(
            f"{file} is no list of results with keypoints, and has no 'annotations'; expected a "
            "file of COCO, or the folder of OpenPose's files"
        )
    names = {}
    for number, image in enumerate((content.get("images") or ()) if is_annotated else ()):
        place = f"{file}, image {number}"
        names[str(_value(image, "id", place))] = Path(str(_value(image, "file_name", place))).name
    seen = set[float]()
    people = []
    for number, person in enumerate(found):
        place = f"{file}, entry {number}"
        image = _value(person, "image_id", place)
        points = _named(_value(person, "keypoints", place), place)
        seen.update(point[3] for point in points)
        # Programs without numbers of images give names.
        named = names.get(str(image), image)
        people.append(FoundPerson(named if isinstance(named, int) else str(named), points, place))
    flags = {0.0, float(_GUESSED), float(_VISIBLE)}
    for person in people:
        if seen <= flags and (is_annotated or _VISIBLE in seen):
            # Of annotations, the third number says whether the point was seen.
            scored: list[NamedPoint] = [
                (*point[:3], point[3] / _VISIBLE) for point in person.points
            ]
            yield person._replace(points=scored)
        else:
            yield person


def _content(file: Path, most_bytes: int) -> Any:
    with foreign(file, CardboxError, "JSON of OpenPose or COCO"):
        data = read_regular(file, most_bytes)
        # Empty objects take thirty times their bytes.
        if data.count(b"{") + data.count(b"[") > _MOST_PARTS:
            raise CardboxError(f"it has more than {_MOST_PARTS} lists and objects")
        return json.loads(data)


def _value(entry: Any, name: str, place: str) -> Any:
    if not isinstance(entry, dict) or name not in entry:
        raise CardboxError(f"{place} has no {name}; expected a file of OpenPose or COCO")
    return entry[name]


def _listed(numbers: Iterable[int]) -> str:
    *most, last = map(str, numbers)
    return f"{', '.join(most)} or {last}" if most else last


def _named(
    values: Any, place: str, layouts: dict[int, tuple[str, ...]] = LAYOUTS
) -> list[NamedPoint]:
    """Return the points of a flat list of columns, rows and scores."""
    is_list = isinstance(values, list)
    names: Sequence[str] | None = layouts.get(len(values) // 3) if is_list else None
    if names is None or len(values) % 3:
        raise CardboxError(
            f"{place}, has {len(values) if is_list else 'no'} numbers; expected column, row and "
            f"score of {_listed(layouts)} points"
        )
    try:
        flat = [float(value) for value in values]
    except (TypeError, ValueError, OverflowError):
        raise CardboxError(f"{place}, has a value that is no number") from None
    if len(names) == len(_BODY_25B) and _is_25b(flat):
        names = _BODY_25B
    return [(name, *flat[3 * i : 3 * i + 3]) for i, name in enumerate(names)]  # type: ignore[misc]


def _is_25b(values: Sequence[float]) -> bool:
    """Return whether 25 points are of BODY_25B, where eyes and ears follow the nose."""
    points = np.reshape(values, (-1, 3))
    away = np.hypot(*(points[:, :2] - points[0, :2]).T)
    known = points[:, 2] > 0.0

    def spread(numbers: range) -> float:
        there = known[numbers.start : numbers.stop]
        return float(np.mean(away[numbers.start : numbers.stop][there])) if there.any() else np.inf

    return bool(known[0]) and spread(range(1, 5)) < spread(range(15, 19))
