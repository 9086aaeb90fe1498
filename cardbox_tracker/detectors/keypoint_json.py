"""Points of people in the JSON files of other programs: OpenPose's, MMPose's, and COCO's.

OpenPose writes a file for each image, whose name has the image's number from 0 on; so do Sports2D
and Pose2Sim, and MMPose for images. A file of COCO has a list of results, or annotations with
images, and one of MMPose a list of images. Points have the order that the file declares; without
one, their number tells it.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.detectors.image_points import COCO_NAMES
from cardbox_tracker.detectors.point_checks import NamedPoint, count_person

_MOST_BYTES, _MOST_OF_IMAGE = 256 * 1024 * 1024, 16 * 1024 * 1024
# Some ten hours of one person.
_MOST_PARTS = 4_000_000
_HAND_POINTS, _INDEX, _LITTLE_FINGER = 21, 5, 17
# In the names of points that a file declares, such as left_shoulder, LShoulder or shoulder-l.
_PARTS = {
    name: name
    for name in ("eye", "ear", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "heel")
} | {"bigtoe": "foot", "forefinger1": "index", "pinkyfinger1": "little_finger"}
_SIDE = "(l|r)(?:eft|ight)?"
_DECLARED = re.compile(rf"{_SIDE}({'|'.join(_PARTS)})|({'|'.join(_PARTS)}){_SIDE}")
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
_SHOULDERS = "left_shoulder", "right_shoulder"
# Big toe, small toe and heel of each foot.
_FEET = [name for side in _SIDES for name in (f"{side}_foot", f"{side} small toe", f"{side}_heel")]
_HALPE = (*COCO_NAMES, *_others(3), *_FEET[::3], *_FEET[1::3], *_FEET[2::3])
_BODY_25B = (*COCO_NAMES, *_others(2), *_FEET)
_FACE = ("right_eye", "left_eye", "right_ear", "left_ear")
LAYOUTS: dict[int, tuple[str, ...]] = {
    17: COCO_NAMES,
    18: (*_UPPER, *_LEGS, *_FACE),
    25: (*_UPPER, "hips", *_LEGS, *_FACE, *_FEET),
    26: _HALPE,
    133: (*COCO_NAMES, *_FEET, *_others(68), *_hand("left"), *_hand("right")),
    136: (*_HALPE, *_others(68), *_hand("left"), *_hand("right")),
}
"""Names of a person's points by their number: COCO, OpenPose's COCO and BODY_25, Halpe,
COCO-WholeBody, and Halpe with face and hands."""
Layouts = Mapping[int, Sequence[str]]


class FoundPerson(NamedTuple):
    """The points of one person in one image."""

    image: int | str  #: number of the image, counted from 0, or its name
    points: list[NamedPoint]  #: the points
    place: str  #: where they stand, for errors


def openpose_people(folder: Path) -> Iterator[FoundPerson]:
    """Yield the people in a folder of OpenPose's files; raise CardboxError if there are none."""
    # macOS puts a hidden file beside each on drives of other systems.
    files = sorted(file for file in folder.glob("*.json") if not file.name.startswith("."))
    if not files:
        raise CardboxError(
            f"{folder} has no JSON files; expected those of OpenPose, one for each image, such as "
            "film_000000000012_keypoints.json"
        )
    numbers, counts = image_numbers(file.stem for file in files), Counter[str]()
    for file in files:
        if file.stem not in numbers:
            raise CardboxError(
                f"the name of {file} has no number; expected that of the image, counted from 0, "
                "such as film_000000000012_keypoints.json"
            )
        content = _content(file, _MOST_OF_IMAGE)
        # Of images without people, some programs write an empty object or list.
        people = content.get("people", content and "none") if isinstance(content, dict) else content
        if not isinstance(people or [], list):
            raise CardboxError(f"{file} has no list 'people'; expected a file of OpenPose")
        for number, person in enumerate(people or ()):
            place = f"{file}, person {number}"
            count_person(counts, numbers[file.stem])
            points = _points(person, place, LAYOUTS, "pose_keypoints_2d", "keypoints")
            for side in ("left", "right"):
                hand = {_HAND_POINTS: _hand(side)}
                points += _points(person, place, hand, f"hand_{side}_keypoints_2d")
            yield FoundPerson(numbers[file.stem], points, place)


def image_numbers(names: Iterable[str]) -> dict[str, int]:
    """Return the number of the image in each name of a file that has one.

    Of several numbers in all names, it is the one with most values, and of these the last.
    """
    found = {name: tuple(map(int, re.findall(r"\d+", name))) for name in names}
    most, place = 0, -1
    if len(set(map(len, found.values()))) == 1:
        for i, values in enumerate(zip(*found.values(), strict=True)):
            if len(set(values)) >= most:
                most, place = len(set(values)), i
    return {name: numbers[place] for name, numbers in found.items() if numbers}


def coco_people(file: Path) -> Iterator[FoundPerson]:
    """Yield people in a file of COCO or MMPose; raise CardboxError if it is none or unreadable."""
    content = _content(file, _MOST_BYTES)
    is_annotated = isinstance(content, dict)
    found = content.get("annotations", content.get("instance_info")) if is_annotated else content
    if not isinstance(found, list):
        raise CardboxError(
            f"{file} is no list of results with keypoints, and has no 'annotations'; expected a "
            "file of COCO, or the folder of OpenPose's files"
        )
    names = {}
    for number, image in enumerate((content.get("images") or ()) if is_annotated else ()):
        place = f"{file}, image {number}"
        names[str(_value(image, "id", place))] = Path(str(_value(image, "file_name", place))).name
    orders = _orders(content, file) if is_annotated else {}
    seen, counts = set[float](), Counter[str]()
    people = []
    for number, person in enumerate(_of_images(found)):
        place = f"{file}, entry {number}"
        image = _value(person, "image_id", place)
        count_person(counts, image)
        layouts = orders.get("") or orders.get(str(person.get("category_id")))
        if orders and layouts is None:
            continue
        points = _points(person, place, layouts or LAYOUTS, "keypoints")
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


def _of_images(found: list[Any]) -> Iterator[Any]:
    """Yield entries, of images of MMPose each person; its program for films counts them from 1."""
    first: int | None = None
    for entry in found:
        if not isinstance(entry, dict) or not isinstance(entry.get("instances"), list):
            yield entry
            continue
        number = entry.get("frame_id")
        if not isinstance(number, int):
            raise CardboxError("an image has no frame_id; expected a file of MMPose")
        first = number if first is None else first
        for person in entry["instances"]:
            if isinstance(person, dict):
                yield {**person, "image_id": number - (first == 1)}


def _orders(content: dict[str, Any], file: Path) -> dict[str, Layouts]:
    """Return the order of points that a file declares for categories of people, "" if there is one.

    Raises CardboxError if all its categories have names of points, but none has shoulders.
    """
    declared: dict[str, list[Any]] = {}
    of_mmpose = content.get("meta_info")
    kinds = content.get("categories")
    for kind in kinds if isinstance(kinds, list) else ():
        if isinstance(kind, dict) and kind.get("keypoints") and isinstance(kind["keypoints"], list):
            declared[str(kind.get("id"))] = kind["keypoints"]
    if isinstance(of_mmpose, dict) and isinstance(of_mmpose.get("keypoint_id2name"), dict):
        names = of_mmpose["keypoint_id2name"]
        declared = {"": [names.get(str(i)) for i in range(len(names))]}
    orders = {kind: [plain_name(str(name)) for name in names] for kind, names in declared.items()}
    people = {kind: of for kind, of in orders.items() if set(_SHOULDERS) <= set(of)}
    if declared and not people:
        listed = quoted(", ".join(map(str, next(iter(declared.values())))))
        raise CardboxError(
            f"{file} names its points {listed}; expected names such as "
            f"{' and '.join(_SHOULDERS)}: give those in 'categories'"
        )
    return {kind if len(orders) > 1 else "": {len(of): of} for kind, of in people.items()}


@lru_cache(maxsize=1024)
def plain_name(name: str) -> str:
    """Return our name of a point that a file names; the same name if it is not used."""
    found = _DECLARED.fullmatch(re.sub("[^a-z0-9]", "", name.lower()))
    if found is None:
        return name.lower()
    before, part, other, after = found.groups()
    return f"{'left' if (before or after) == 'l' else 'right'}_{_PARTS[part or other]}"


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


def _points(person: Any, place: str, layouts: Layouts, *keys: str) -> list[NamedPoint]:
    """Return the points below the first of ``keys`` that a person has; none without points.

    They are a flat list of columns, rows and scores, or a list of each point, as MMPose's, whose
    scores are apart.
    """
    if not isinstance(person or {}, dict):
        raise CardboxError(f"{place} has no {keys[0]}; expected a file of OpenPose or COCO")
    values = next((person[key] for key in keys if person and person.get(key)), None)
    if values is None:
        return []
    is_list = isinstance(values, list)
    if is_list and all(isinstance(point, list) and len(point) in (2, 3) for point in values):
        scores = person.get("keypoint_scores") or [point[2:] for point in values]
        apart = zip(values, scores if isinstance(scores, list) else (), strict=False)
        values = [one for at, score in apart for one in (*at[:2], *np.ravel(score).tolist())]
    names = layouts.get(len(values) // 3) if is_list else None
    if names is None or len(values) % 3:
        raise CardboxError(
            f"{place}, has {len(values) if is_list else 'no'} numbers; expected column, row and "
            f"score of {_listed(layouts)} points"
        )
    try:
        flat = [float(value) for value in values]
    except (TypeError, ValueError, OverflowError):
        raise CardboxError(f"{place}, has a value that is no number") from None
    if names is LAYOUTS[len(_BODY_25B)] and _is_25b(flat):
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
