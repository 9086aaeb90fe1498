"""A detector of one's own in the place of MediaPipe's networks (``docs/extending.md``)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.given_arrays import silhouette_from
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.detectors.point_checks import check_person, check_point
from cardbox_tracker.detectors.pose_network import (
    LANDMARKS,
    POINTS,
    ColorImage,
    Detection,
    PoseNetwork,
    Square,
    figure_of,
)

MASK = "mask"
"""Name of the mask among the points of a person."""


class FindsPeople(Protocol):
    """What a detector of one's own has."""

    def detect(self, image: ColorImage) -> Iterable[Mapping[str, Any]]:
        """Return the people in an image, the most certain one first.

        Args:
            image: (H, W, 3), bgr, undistorted, at the resolution that the tracker works with.

        Returns:
            For each person column and row, px, and score, 0 to 1, by names of ``LANDMARKS``, and if
            it has one the ``mask``, (H, W). Points that are not known are missing or have score 0.
        """


class OwnModel(NamedTuple):
    """Where a detector of one's own is from.

    Attributes:
        make: the class, or another function that returns a detector.
        source: its file, by which a changed one is told; None if it is not known.
    """

    make: Callable[[], FindsPeople]
    source: Path | None = None

    @classmethod
    def of(cls, given: object, name: str) -> OwnModel:
        """Return the model of a detector, or of a class that is made without arguments.

        Raises:
            CardboxError: it has no ``detect``.
        """
        if not _finds_people(given):
            raise CardboxError(f"{name} has no function detect(image); docs/extending.md has one")
        if not isinstance(given, type):
            return cls(lambda: given)
        try:
            return cls(given, Path(inspect.getfile(given)))
        except (OSError, TypeError):
            return cls(given)


def _finds_people(given: object) -> TypeGuard[FindsPeople]:
    return callable(getattr(given, "detect", None))


class OwnNetwork(PoseNetwork):
    """Follows one person among the people whom a detector of one's own finds."""

    def __init__(self, detector: FindsPeople) -> None:
        """Use the detector."""
        self._own, self.choose = detector, None
        self.forget()

    def forget(self) -> None:
        """Follow whoever is in the next image."""
        super().forget()
        self._looked, self._found = 0, list[tuple[Detection, Square]]()

    def people_in(self, image: ColorImage) -> list[Detection]:
        """Return the people in an image (H, W, 3), bgr.

        Raises:
            CardboxError: what the detector returns are no people; the text has the name.
        """
        name = type(self._own).__name__
        people: Any = self._own.detect(np.ascontiguousarray(image))
        if not isinstance(people, Iterable):
            raise CardboxError(f"{name}.detect returns {quoted(people)}; expected a list of people")
        found = []
        for number, person in enumerate(people):
            try:
                found.append(_detection(person, image.shape[:2]))
            except (CardboxError, ValueError, TypeError, AttributeError) as error:
                raise CardboxError(
                    f"{name}.detect, person {number}: {error}; expected column, row and score by "
                    "the name of the point"
                ) from None
        return [one for one in found if one.scores.any()]

    def detected(self, image: ColorImage, view: Square) -> list[Square]:
        """Return squares around the people in an rgb image, the most certain one first."""
        return [square for _, square in self._now(image)]

    def located(
        self, image: ColorImage, square: Square, others: NDArray[np.uint8] | None = None
    ) -> tuple[Detection, Square] | None:
        """Return the person nearest to a square; None if nobody is in the rgb image."""

        def away(found: tuple[Detection, Square]) -> float:
            return float(np.hypot(found[1].u - square.u, found[1].v - square.v))

        return min(self._now(image), key=away, default=None)

    def _now(self, image: ColorImage) -> list[tuple[Detection, Square]]:
        """Return the people in an rgb image, in which the detector looks once."""
        if self._looked != self._images:
            people = self.people_in(image[..., ::-1])
            self._looked, self._found = self._images, [(one, _around(one)) for one in people]
        return self._found


def _detection(person: Mapping[str, Any], shape: tuple[int, int]) -> Detection:
    points_px, scores = np.full((POINTS, 2), np.nan), np.zeros(POINTS)
    known = {}
    for name, values in person.items():
        if name == MASK:
            continue
        if name not in LANDMARKS:
            raise ValueError(f"{quoted(name)} is no point; those are {', '.join(LANDMARKS)}")
        column, row, score = map(float, values)
        check_point((name, column, row, score), (shape[1], shape[0]))
        if score > 0.0:
            known[name] = column, row, score
            points_px[LANDMARKS.index(name)], scores[LANDMARKS.index(name)] = (column, row), score
    check_person(known)
    found = Detection(points_px, scores, np.zeros(shape, np.uint8))
    if person.get(MASK) is None:
        return found._replace(mask=figure_of(found).drawn(shape))
    return found._replace(mask=silhouette_from(person[MASK], MASK, shape))


def _around(found: Detection) -> Square:
    px = found.points_px[found.scores > 0.0]
    (left, top), (right, bottom) = px.min(axis=0), px.max(axis=0)
    return Square((left + right) / 2, (top + bottom) / 2, max(right - left, bottom - top), 0.0)
