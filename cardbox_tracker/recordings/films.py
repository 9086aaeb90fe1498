"""Several films of the same people: who is in them, when they begin, and where their cameras stand.

Each film is read once. What the detector finds, and small images, are kept for tracking.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import GONE_NS, cheapest, colours_in, learned, unlike
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.film_cameras import (
    LEAST_IMAGES,
    Film,
    FilmCamera,
    Seen,
    film_cameras,
)
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource

# Deviation of a rotation from which on it is doubtful, and from which on one film alone tells more.
_SURE_DEG, _USABLE_DEG = 3.0, 5.0


@dataclass
class Person:
    """Somebody whom a detector sees in a recording: points so far, last figure, colours."""

    figure: Figure | None = None
    colours: FloatArray | None = None
    seen: list[tuple[float, ImagePoints]] = field(default_factory=list)


def assign(people: list[Person], frame: RecordedFrame, time_s: float) -> None:
    """Add the points in a frame to the people who they are by place and colours, or to new ones."""
    shown = list[tuple[ImagePoints, Figure, FloatArray | None]]()
    for points in frame.people if frame.people is not None else (frame.points,):
        if points is not None:
            figure = figure_of_points(points)
            trunk = figure.trunk(frame.silhouette.shape) & frame.silhouette
            shown.append((points, figure, colours_in(frame.image, trunk)))
    # Who was away for longer may be somebody else with the same clothes.
    known = [(one, round(1e9 * (time_s - one.seen[-1][0]))) for one in people]
    known = [(one, away_ns) for one, away_ns in known if 0 < away_ns <= GONE_NS]
    costs = [
        [unlike(one.figure, one.colours, figure, their, ns) for _, figure, their in shown]
        for one, ns in known
    ]
    found = {column: known[row][0] for row, column in cheapest(costs).items()}
    for column, (points, figure, colours) in enumerate(shown):
        if column not in found:
            people.append(Person())
        person = found.get(column, people[-1])
        person.seen.append((time_s, points))
        person.figure = figure
        if colours is not None:
            person.colours = learned(person.colours, colours)


class PlacedFilm(NamedTuple):
    """A further film beside the first one."""

    name: str  #: for texts
    camera: FilmCamera  #: its time and pose
    span_s: tuple[float, float]  #: when it begins and ends, by the time of the first film
    #: stamps of those of its images that are nearest to an image of the first film, ns
    chosen_ns: frozenset[int]

    @property
    def turn_deg(self) -> float:
        """Standard deviation of the camera's rotation, degrees."""
        return math.degrees(self.camera.turn_stddev_rad)

    @property
    def is_usable(self) -> bool:
        """Whether the people are better known with the film than without it."""
        return self.turn_deg <= _USABLE_DEG

    def frames(self, source: SilhouetteSource) -> Iterator[RecordedFrame]:
        """Yield these images by the time of the first film."""
        shift_ns = round(1e9 * self.camera.offset_s)
        for frame in source.frames():
            if frame.stamp_ns in self.chosen_ns:
                stamp_ns = frame.stamp_ns + shift_ns
                yield frame._replace(stamp_ns=stamp_ns, time_s=stamp_ns / 1e9)

    def remarks(self, first: str, lasts_s: float) -> Iterator[str]:
        """Yield what is to be known of a film beside the ``first`` one, which lasts ``lasts_s``."""
        begin_s, end_s = max(0.0, self.span_s[0]), min(lasts_s, self.span_s[1])
        if begin_s > 0.0 or end_s < lasts_s:
            yield (
                f"{self.name} overlaps with {first} from {begin_s:.2f} to {end_s:.2f} of "
                f"{lasts_s:.2f} s; the rest is tracked without it"
            )
        if not self.camera.is_clear:
            yield (
                f"people in {self.name} and {first} move alike hardly more than by chance if it "
                f"begins at {self.camera.offset_s:.2f} s: check that both show the same people at "
                "one time, and give --offset if it is known"
            )
        if self.camera.is_doubtful or self.turn_deg > _SURE_DEG:
            end = "" if self.is_usable else ", so the film is not used"
            yield (
                f"where the camera of {self.name} stands is doubtful, to {self.turn_deg:.0f} "
                f"degrees and {self.camera.place_stddev_m:.2f} m{end}: film people who walk about, "
                "near to the cameras, or give --extrinsics"
            )


def placed_films(
    names: Sequence[str],
    sources: Sequence[SilhouetteSource],
    offsets_s: Sequence[float | None],
    extrinsics: Mapping[str, Extrinsics],
    statures_m: Sequence[float],
) -> list[PlacedFilm]:
    """Read films, and return all but the first one with their times and poses.

    Args:
        names: of the films.
        sources: their images and points.
        offsets_s: when further films begin, s of the first one; None to find it.
        extrinsics: those that are given of further films, by name.
        statures_m: statures of the people by number; empty for that of most adults.

    Raises:
        CameraError: a film does not overlap with the first one, or shows other people.
    """
    films, stamps_ns = list[Film](), list[list[int]]()
    for name, source, offset_s in zip(names, sources, (None, *offsets_s), strict=True):
        source.keep_images()
        people, stamps = list[Person](), list[int]()
        for frame in source.frames():
            stamps.append(frame.stamp_ns)
            assign(people, frame, frame.time_s)
        shown = [one.seen for one in people if len(one.seen) >= LEAST_IMAGES]
        # People are numbered as they come, and from left to right.
        shown.sort(key=lambda seen: (seen[0][0], np.nanmean(seen[0][1].px[:, 0])))
        seen = [Seen(one, source.camera) for one in shown]
        films.append(Film(name, seen, offset_s, extrinsics.get(name)))
        stamps_ns.append(stamps)
    found = film_cameras(films, statures_m or (USUAL_STATURE_M,))
    return [
        _placed(name, camera, *map(np.array, (stamps_ns[0], stamps)))
        for name, camera, stamps in zip(names[1:], found, stamps_ns[1:], strict=True)
    ]


def _placed(name: str, camera: FilmCamera, first_ns: FloatArray, own_ns: FloatArray) -> PlacedFilm:
    shift_ns = round(1e9 * camera.offset_s)
    after = np.clip(np.searchsorted(own_ns, first_ns - shift_ns), 1, len(own_ns) - 1)
    is_before = 2 * (first_ns - shift_ns) < own_ns[after - 1] + own_ns[after]
    chosen_ns = frozenset(own_ns[after - is_before].tolist())
    span_s = (own_ns[0] + shift_ns) / 1e9, (own_ns[-1] + shift_ns) / 1e9
    return PlacedFilm(name, camera, span_s, chosen_ns)
