"""A detector of one's own in the place of MediaPipe's networks (``docs/extending.md``)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.given_arrays import silhouette_from
from cardbox_tracker.common.errors import CardboxError, quoted, reason_of
from cardbox_tracker.common.extensions import called
from cardbox_tracker.detectors.point_checks import MOST_PEOPLE, check_person, check_point
from cardbox_tracker.detectors.pose_network import (
    LANDMARKS,
    POINTS,
    ColorImage,
    Detection,
    PoseNetwork,
    Square,
    figure_of,
)

_MASK = "mask"


class FindsPeople(Protocol):
    """A detector of one's own."""

    def detect(self, image: ColorImage) -> Iterable[Mapping[str, Any]]:
        """Return the people in an undistorted image (H, W, 3), bgr, the most certain one first.

        Each has column, row (px) and score (0 to 1) by names of ``LANDMARKS``, and may have x, y
        and z as in ``ImagePoints.spatial_m``; points with score 0 are missing. ``mask``, (H, W),
        may be the pixels of the person.
        """


class OwnModel(NamedTuple):
    """A detector's class, or a function that returns one, and its file, whose change counts."""

    make: Callable[[], FindsPeople]
    name: str
    source: Path | None = None

    @classmethod
    def of(cls, given: Any, name: str) -> OwnModel:
        """Return the model of a detector, or of its class; CardboxError if it has no ``detect``."""
        if not callable(getattr(given, "detect", None)):
            raise CardboxError(f"{name} has no function detect(image); docs/extending.md has one")
        if not isinstance(given, type):
            return cls(lambda: given, name)
        with suppress(OSError, TypeError):
            return cls(given, name, Path(inspect.getfile(given)))
        return cls(given, name)


class OwnNetwork(PoseNetwork):
    """Follows one person among those whom a detector of one's own finds."""

    def __init__(self, model: OwnModel) -> None:
        """Make the detector; CardboxError if that fails."""
        self._own = called(model.make, f"{model.name} does not start")
        self._found: list[tuple[Detection, Square]] = []
        self.forget()

    def __call__(self, image: ColorImage, stamp_ns: int | None = None) -> Detection | None:
        """Return the person in an image (H, W, 3), bgr, of a time, ns; None if not seen."""
        self._found = [(one, _around(one)) for one in self.people_in(image)]
        return super().__call__(image, stamp_ns)

    def people_in(self, image: ColorImage) -> list[Detection]:
        """Return the people in an image (H, W, 3), bgr; CardboxError if what is found are none."""
        name = f"{type(self._own).__name__}.detect"

        def detect() -> list[Detection]:
            # Who draws into the image must not change what others see.
            people: Any = self._own.detect(image.copy())
            if not isinstance(people, Iterable):
                raise CardboxError(f"{name} returns {quoted(people)}; expected a list of people")
            listed, found = list(islice(people, MOST_PEOPLE + 1)), list[Detection]()
            if len(listed) > MOST_PEOPLE:
                raise CardboxError(f"{name} returns more than {MOST_PEOPLE} people in an image")
            for number, person in enumerate(listed):
                try:
                    found.append(_detection(person, image.shape[:2]))
                except Exception as error:
                    raise CardboxError(
                        f"{name}, person {number}: {reason_of(error)}; expected column, row and "
                        "score, or these and x, y and z, by names of points"
                    ) from None
            return found

        found = called(detect, f"{name} fails", "; expected a list of people (docs/extending.md)")
        return [one for one in found if one.scores.any()]

    def detected(self, image: ColorImage, view: Square) -> list[Square]:
        """Return squares around the people in the image, the most certain one first."""
        return [square for _, square in self._found]

    def located(
        self, image: ColorImage, square: Square, others: NDArray[np.uint8] | None = None
    ) -> tuple[Detection, Square] | None:
        """Return the person in the image who is nearest to a square; None if there is nobody."""

        def away(found: tuple[Detection, Square]) -> float:
            return float(np.hypot(found[1].u - square.u, found[1].v - square.v))

        return min(self._found, key=away, default=None)


def _detection(person: Mapping[str, Any], shape: tuple[int, int]) -> Detection:
    points_px, scores, known = np.full((POINTS, 2), np.nan), np.zeros(POINTS), {}
    spatial_m = np.full((POINTS, 3), np.nan)
    for name, values in person.items():
        if name == _MASK:
            continue
        if name not in LANDMARKS:
            raise ValueError(f"{quoted(name)} is no point; those are {', '.join(LANDMARKS)}")
        # One more than there may be, since a generator need not end.
        column, row, score, *space = map(float, islice(values, 7))
        if len(space) not in (0, 3):
            more = " or more" if len(space) > 3 else ""
            raise ValueError(f"{name} has {3 + len(space)} numbers{more}, not 3 or 6")
        check_point((name, column, row, score), shape[::-1])
        if score > 0.0:
            number = LANDMARKS.index(name)
            known[name] = column, row, score
            points_px[number], scores[number] = (column, row), min(score, 1.0)
            spatial_m[number, : len(space)] = space
    check_person(known)
    found = Detection(points_px, scores, np.zeros(shape, np.uint8))
    if np.isfinite(spatial_m).any():
        found = found._replace(spatial_m=spatial_m)
    mask = person.get(_MASK)
    if mask is None:
        mask = figure_of(found).drawn(shape)
    return found._replace(mask=silhouette_from(mask, _MASK, shape))


def _around(found: Detection) -> Square:
    px = found.points_px[found.scores > 0.0]
    middle, side = (px.min(axis=0) + px.max(axis=0)) / 2, np.ptp(px, axis=0).max()
    return Square(float(middle[0]), float(middle[1]), float(side), 0.0)
