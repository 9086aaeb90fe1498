"""Choice of the tracked person among several in an image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.pose_network import Square

# Joints near the outline may lie this far outside the silhouette.
_MARGIN_PX = 5
_LEAST_SILHOUETTE = 0.003
LEAST_INSIDE = 0.25
"""Points are those of somebody else if a smaller share of them is in the silhouette."""


@dataclass(frozen=True)
class PersonChoice:
    """Which of several people to follow."""

    which: str  #: ``left`` or ``right`` in the image, ``largest``, or ``place``
    #: column and row of the person's hips or chest, px, for ``place``.
    place: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def parse(cls, text: str) -> PersonChoice:
        """Read ``left``, ``right``, ``largest`` or ``X,Y``; ValueError if it is none of these."""
        if text in ("left", "right", "largest"):
            return cls(text)
        try:
            column, row = map(float, text.split(","))
        except ValueError:
            column = row = np.nan
        if not (isfinite(column) and isfinite(row)):
            raise ValueError(
                f"expected left, right, largest, or X,Y: column and row of the person, got {text!r}"
            )
        return cls("place", (column, row))

    def scaled(self, across: float, down: float) -> PersonChoice:
        """Return the choice in an image whose sides are ``across`` and ``down`` times as long."""
        return replace(self, place=(across * self.place[0], down * self.place[1]))

    def __call__(self, people: Sequence[Square]) -> Square:
        """Return one of the squares around people, see ``Choose``."""
        column, row = self.place
        keys: dict[str, Callable[[Square], float]] = {
            "left": lambda one: one.u,
            "right": lambda one: -one.u,
            "largest": lambda one: -one.side,
            "place": lambda one: hypot(one.u - column, one.v - row),
        }
        return min(people, key=keys[self.which])


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
