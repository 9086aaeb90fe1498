"""The check of points that another program has found, whether they come in files or messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite

import numpy as np

from cardbox_tracker.common.errors import CardboxError, cut, quoted
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints

Size = tuple[int, int]
"""Width and height of the camera's image, px."""
NamedPoint = tuple[str, float, float, float, *tuple[float, ...]]
"""Name, column and row (px), and score of a point, and its x, y and z in space if it has them."""

# Some networks give scores somewhat above 1, which count as 1, and below 0 to missing points;
# beyond these are percentages, bytes and other numbers.
_LEAST_SCORE, _MOST_SCORE = -1.0, 10.0
# A point may lie outside the image, but by no more than this multiple of the larger side.
_MOST_OUTSIDE = 1.0
# No person is as small as this, px; shares of the image are from 0 to 1, and guesses beyond it.
_SHARES, _LEAST_POINTS = 1.5, 3
MOST_PEOPLE = 200
"""More people in an image are refused, as those of all images in one; they would take minutes."""


def count_person(people: Counter[str], image: object) -> None:
    """Count one more of the ``people`` by image; CardboxError above :data:`MOST_PEOPLE`."""
    people[str(image)] += 1
    if people[str(image)] > MOST_PEOPLE:
        raise CardboxError(
            f"image {quoted(image)} has more than {MOST_PEOPLE} people; expected those of "
            "one image in each: check the numbers of the images"
        )


def check_point(point: NamedPoint, size: Size | None) -> None:
    """Raise CardboxError if a score is no chance, or, above 0, its place far off the image."""
    name, column, row, score, *_ = point
    if not _LEAST_SCORE <= score <= _MOST_SCORE:
        raise CardboxError(
            f"{cut(name)} has the score {score:g}; expected a chance from 0 to 1: divide "
            "percentages by 100"
        )
    if score <= 0.0:
        return
    far_px = np.inf if size is None else _MOST_OUTSIDE * max(size)
    sides = zip((column, row), size or (0, 0), strict=True)
    if not all(isfinite(at) and -far_px <= at <= side + far_px for at, side in sides):
        of = "" if size is None else f" of {size[0]}x{size[1]} px"
        raise CardboxError(
            f"{cut(name)} is at {quoted((column, row))} px; expected a place in the camera's "
            f"image{of}, or the score 0 if the point is missing"
        )


def person_of(points: Iterable[NamedPoint], size: Size | None) -> ImagePoints:
    """Return the person of some points, which are checked; one of a score up to 0 is missing."""
    found = {}
    for point in points:
        check_point(point, size)
        if point[3] > 0.0:
            found[point[0]] = point[1:]
    check_person(found)
    return ImagePoints.of(found)


def check_person(found: Mapping[str, Sequence[float]]) -> None:
    """Raise CardboxError if the points of one person, by name, are shares of the image."""
    places = np.array([point[:2] for point in found.values()])
    if len(places) >= _LEAST_POINTS and np.abs(places).max() <= _SHARES:
        raise CardboxError(
            f"all points of a person are within {_SHARES:g} px of the image's corner, as shares of "
            "the image from 0 to 1 are; expected pixels: multiply columns by the width of the "
            "image, and rows by its height"
        )


def check_places(person: ImagePoints, size: Size) -> None:
    """Check the places of points that were read before the ``size`` of the image was known."""
    points = zip(POINT_NAMES, person.px.tolist(), person.scores.tolist(), strict=True)
    for name, (column, row), score in points:
        check_point((name, column, row, score), size)
