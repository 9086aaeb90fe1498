"""Choice of the tracked person among several in an image."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, inf, isfinite, nan

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import quoted
from cardbox_tracker.detectors.identity import KNOWN_IMAGES
from cardbox_tracker.detectors.image_points import ImagePoints

# Joints near the outline may lie this far outside the silhouette.
_MARGIN_PX = 5
_LEAST_SILHOUETTE = 0.003
LEAST_INSIDE = 0.25
"""Points are those of somebody else if a smaller share of them is in the silhouette."""


@dataclass(frozen=True)
class PersonChoice:
    """Which of several people to follow."""

    which: str  #: ``left`` or ``right`` in the image, ``largest``, or ``place``
    #: column and row at which the person is, px, for ``place``.
    place: tuple[float, float] = (0.0, 0.0)
    #: second from which on images count, from the start of the recording; None for all images.
    time_s: float | None = None

    @classmethod
    def parse(cls, text: str) -> PersonChoice:
        """Read ``left``, ``right``, ``largest`` or ``X,Y``, also with ``@T``; ValueError if not."""
        which, at, time = text.partition("@")
        place = (0.0, 0.0)
        try:
            time_s = float(time) if at else None
            if which not in ("left", "right", "largest"):
                column, row = map(float, which.split(","))
                which, place = "place", (column, row)
        except ValueError:
            time_s = nan
        if not (all(map(isfinite, place)) and 0.0 <= (time_s or 0.0) < inf):
            raise ValueError(
                "expected left, right, largest, or X,Y: column and row of the person, also with "
                f"@T for the second T, such as left@12.5, got {quoted(text)}"
            )
        return cls(which, place, time_s)

    def scaled(self, across: float, down: float) -> PersonChoice:
        """Return the choice in an image whose sides are ``across`` and ``down`` times as long."""
        return replace(self, place=(across * self.place[0], down * self.place[1]))


class Chosen:
    """The one of several identities whom a choice means, by image after image.

    It is decided in the first image that shows two known people, or somebody at the place; without
    such an image, in the one that comes nearest to it. Who is seen in few images may be an error of
    the detector, and is not known.

    Attributes:
        number: number of the person; None before somebody is seen.
    """

    def __init__(self, choice: PersonChoice) -> None:
        self._choice, self._images = choice, Counter[int]()
        self.number: int | None = None
        # How well the image of the decision fits, its time, and how many people it shows.
        self._fit, self._time_s, self._count = -inf, 0.0, 0

    def see(self, time_s: float, shown: Mapping[int, NDArray[np.uint8]]) -> None:
        """Take the pixels (H, W), not 0, of each person in an image, by number, at a time, s."""
        which, (column, row) = self._choice.which, self._choice.place
        self._images.update(shown.keys())
        if not shown or time_s < (self._choice.time_s or 0.0):
            return
        known = [number for number in shown if self._images[number] >= KNOWN_IMAGES]
        people = {number: shown[number] for number in known or shown}
        middles = {number: np.argwhere(one > 0).mean(axis=0) for number, one in people.items()}
        fit = float(min(len(known), 2))
        if which == "place":
            away = {number: _away_px(one, column, row) for number, one in people.items()}
            number = min(people, key=lambda n: (away[n], hypot(*middles[n] - (row, column))))
            fit = -away[number] if known else -inf
        elif which == "largest":
            number = max(people, key=lambda n: np.count_nonzero(people[n]))
        else:
            sign = 1.0 if which == "left" else -1.0
            number = min(people, key=lambda n: sign * middles[n][1])
        if fit > self._fit or self.number is None:
            self.number, self._fit, self._time_s, self._count = number, fit, time_s, len(people)

    def __str__(self) -> str:
        """Return in words who it is."""
        column, row = self._choice.place
        name = f"the {self._choice.which} one"
        if self._choice.which == "place":
            is_there = self._fit == 0.0
            name = "the one at" if is_there else "nobody is there, so the one nearest to"
            name += f" column {column:g} and row {row:g}"
        return f"person: {name}, of {self._count} at {self._time_s:.1f} s"


def _away_px(pixels: NDArray[np.uint8], column: float, row: float) -> float:
    """Return how far a place is from the pixels (H, W) of a person that are not 0; 0 near them."""
    rows, columns = np.nonzero(pixels)
    nearest_px = float(np.hypot(columns - column, rows - row).min())
    return max(nearest_px - _MARGIN_PX, 0.0)


def person_in(silhouette: NDArray[np.uint8], persons: Sequence[ImagePoints]) -> ImagePoints | None:
    """Return the person whose points lie in the silhouette with the largest sum of scores.

    Without such points it is the one with the most certain points; None if nobody has a point. The
    silhouette is (H, W), 0 or 255, and the points are px of it.
    """
    known = [person for person in persons if not person.is_empty]
    if len(known) < 2:
        return known[0] if known else None
    near = _dilated(silhouette)
    return max(known, key=lambda person: (_support(near, person), person.scores.sum()))


def near_person(silhouette: NDArray[np.uint8]) -> NDArray[np.uint8] | None:
    """Return the pixels (H, W) in and near a silhouette; None if it is too small for a person."""
    if np.count_nonzero(silhouette) < _LEAST_SILHOUETTE * silhouette.size:
        return None
    return _dilated(silhouette)


def inside(near: NDArray[np.uint8], points: ImagePoints) -> float:
    """Return the share of points, by their scores, on pixels of :func:`near_person`; 0 of none."""
    return _support(near, points) / max(float(points.scores.sum()), 1e-9)


def _dilated(silhouette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    kernel = np.ones((2 * _MARGIN_PX + 1, 2 * _MARGIN_PX + 1), np.uint8)
    return np.asarray(cv2.dilate(silhouette, kernel), np.uint8)


def _support(near: NDArray[np.uint8], person: ImagePoints) -> float:
    """Return the sum of the scores of the points on pixels that are not 0."""
    height, width = near.shape
    is_known = person.scores > 0.0
    columns, rows = np.rint(person.px[is_known].T)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    on = near[rows[inside].astype(int), columns[inside].astype(int)] > 0
    return float(person.scores[is_known][inside][on].sum())
