"""Tracking of several people: one tracker for each identity.

Each image shows a few *figures*: people whose joints a detector has found, or regions of the
silhouette that are apart. They are assigned to the known people by place and by the colours of the
trunk; somebody who has left keeps the identity and is known by the colours alone. Each tracker gets
the pixels that are nearest to its person's figure. Pixels of others do not count for it, because
they may hide the person. Somebody whom others hide stays where they were, and is ``uncertain``,
with ``hidden`` keypoints.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import ALIKE, GONE_NS, apart, colours_in
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.doubt import doubted
from cardbox_tracker.terms.term import Image, Silhouette
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, UNCERTAIN, Estimate
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.person_masks import PersonDrawer
from cardbox_tracker.tracking.tracker import Tracker

MOST_PEOPLE = 6
"""People that are tracked if their number is not given."""

# Deviation of a figure's place, in lengths of the trunk, and its growth a second.
_PLACE, _PLACE_PER_S = 0.5, 2.0
# Deviation of the colours of one person: Bhattacharyya distance of the trunk's histograms.
_COLOURS = 0.3
# Change of that distance that changes the odds of being the same person by a factor of e.
_ALIKE_SPREAD = 0.07
# Squared deviations above which a figure is somebody else.
_OTHER = 16.0
# Images in a row with the colours of somebody else after which a person is given up.
_OTHERS_IMAGES = 3
# Share of a figure that others may cover when its colours are learned, and its weight.
_LEARNS, _LEARN_RATE = 0.1, 0.1
# Share of a figure in those of others from which it is hidden, and from which it is a mere mixture.
_HIDDEN, _MIXED = 0.15, 0.5
# Least share of a figure in the silhouette by which somebody is tracked whom the detector misses.
_SEEN = 0.4
# Time for which somebody whom the detector misses stays where they were if nobody hides them, ns.
_DROPPED_NS = 300_000_000
# Time for which a hidden person stays where they were, ns.
_HELD_NS = 3_000_000_000
# Images in a row in which somebody new is seen before they are tracked, after the first images.
_PROVED = 3
# Least area and height of the region of a new person, as shares of the image.
_LEAST_AREA, _LEAST_HEIGHT = 0.01, 0.25
_USUAL_NS = 66_666_667


class Shown(NamedTuple):
    """A figure in one image.

    Attributes:
        points: joints from a detector; None for a region of the silhouette.
        figure: place and size; None for a region.
        pixels: (H, W), 255 at the person's pixels as far as they are known, else 0.
    """

    points: ImagePoints | None
    figure: Figure | None
    pixels: Silhouette


class _Person:
    """One identity."""

    def __init__(self, number: int, tracker: Tracker) -> None:
        self.number, self.tracker = number, tracker
        self.estimate = Estimate(NO_PERSON, person=number)
        self.figure: Figure | None = None
        self.points: ImagePoints | None = None
        self.pixels: Silhouette | None = None
        self.colours: FloatArray | None = None
        self.seen_ns: int | None = None
        self.fitted_ns = self.others_images = 0
        self.chance = 1.0
        self._drawer: PersonDrawer | None = None
        self._body: BodyModel | None = None

    def drawn(self, camera: Camera) -> Silhouette | None:
        """Return the pixels (H, W) of the last posture; None without one."""
        found = self.estimate
        if found.posture is None:
            return None
        body = self.tracker.body
        if self._drawer is None or self._body is not body:
            self._drawer, self._body = PersonDrawer(body, self.tracker.camera), body
        state = np.concatenate(
            [found.posture, np.zeros(2) if found.offset_m is None else found.offset_m]
        )
        cells, side = self._drawer.masks(state, 0.0).core, self._drawer.cell_px
        pixels = np.repeat(np.repeat(cells, side, axis=0), side, axis=1)
        drawn: Silhouette = 255 * pixels[: camera.height, : camera.width]
        return drawn


class People:
    """Tracks several people before one camera."""

    def __init__(
        self,
        bodies: Sequence[BodyModel],
        camera: Camera,
        config: TrackerConfig | None = None,
        rng: np.random.Generator | None = None,
        count: int | None = None,
    ) -> None:
        """Set up for people who may come.

        Args:
            bodies: the body of each person in the order of their numbers; the last one is also that
                of further people. People are numbered as they come, and from left to right if
                they come together.
            camera: working camera.
            config: settings of each tracker.
            rng: source of all noise; seeded with 0 by default.
            count: number of people; None for up to ``MOST_PEOPLE`` who come.
        """
        self._bodies, self._camera, self._config = tuple(bodies), camera, config
        self._rng = rng or np.random.default_rng(0)
        self._most = count or MOST_PEOPLE
        self._people: list[_Person] = []
        self._new = 0
        self._last_ns: int | None = None
        if count is not None:
            for _ in range(count):
                self._add()

    def _add(self) -> _Person:
        number = len(self._people) + 1
        body = self._bodies[min(number, len(self._bodies)) - 1]
        tracker = Tracker(body, self._camera, self._config, self._rng.spawn(1)[0])
        self._people.append(_Person(number, tracker))
        return self._people[-1]

    @property
    def trackers(self) -> list[Tracker]:
        """The tracker of each person, in the order of the numbers."""
        return [person.tracker for person in self._people]

    def points_of(self, number: int) -> ImagePoints | None:
        """Return the points of a person in the last image; None if they were not found."""
        return self._people[number - 1].points

    def reset(self, number: int) -> None:
        """Forget the posture of a person, who keeps the number."""
        person = self._people[number - 1]
        person.tracker.reset()
        person.estimate = Estimate(NO_PERSON, person=number)

    def track(
        self, seen: Observation, points: Sequence[ImagePoints] | None
    ) -> list[tuple[Estimate, Tracker]]:
        """Estimate the postures of all people in an image.

        Args:
            seen: silhouette of all of them, and the image if there is one.
            points: joints of each person whom a detector finds; None without a detector.

        Returns:
            The estimate of each person with their tracker, in the order of the numbers.
        """
        silhouette = seen.silhouette
        if silhouette is None:
            return []
        stamp_ns = seen.stamp_ns
        if stamp_ns is None:
            stamp_ns = 0 if self._last_ns is None else self._last_ns + _USUAL_NS
        self._last_ns, self._shape = stamp_ns, silhouette.shape
        is_detected = points is not None
        shown = self._regions(silhouette) if points is None else _figures(points, silhouette.shape)
        colours = [_colours_of(one, seen.image, silhouette) for one in shown]
        found = self._assigned(shown, colours, stamp_ns)
        found |= self._new_people(shown, colours, found)
        for person in self._people:
            if person.number in found:
                number = found[person.number]
                self._see(person, shown[number], colours[number], stamp_ns)
                continue
            person.points = None
            if not is_detected:
                person.pixels = person.drawn(self._camera)
            if person.seen_ns is not None and not 0 <= stamp_ns - person.seen_ns <= _HELD_NS:
                person.pixels = None
        for person, number in ((p, found[p.number]) for p in self._people if p.number in found):
            self._learn(person, colours[number])
        parts = dict(self._shares(silhouette, found.keys()))
        for person in self._people:
            number, is_shown = person.number, person.number in found
            person.estimate = self._tracked(person, seen, parts.get(number), is_shown, is_detected)
        return [(person.estimate, person.tracker) for person in self._people]

    def _regions(self, silhouette: Silhouette) -> list[Shown]:
        """Return the regions of a silhouette that nobody who is known occupies."""
        drawn = [pixels for p in self._people if (pixels := p.drawn(self._camera)) is not None]
        taken = np.bitwise_or.reduce(drawn) if drawn else np.zeros_like(silhouette)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(silhouette)
        shown = []
        for label in range(1, count):
            height, area = stats[label, cv2.CC_STAT_HEIGHT], stats[label, cv2.CC_STAT_AREA]
            is_small = area < _LEAST_AREA * silhouette.size or height < _LEAST_HEIGHT * len(labels)
            region = labels == label
            if not is_small and not (taken[region] > 0).any():
                shown.append(Shown(None, None, np.where(region, np.uint8(255), np.uint8(0))))
        return shown

    def _assigned(
        self, shown: Sequence[Shown], colours: Sequence[FloatArray | None], stamp_ns: int
    ) -> dict[int, int]:
        """Return which figure each known person is, by number."""
        known = [person for person in self._people if person.seen_ns is not None]
        costs = np.full((len(known), len(shown)), _OTHER)
        for row, person in enumerate(known):
            for column, one in enumerate(shown):
                costs[row, column] = self._cost(person, one, colours[column], stamp_ns)
        return {known[row].number: column for row, column in _cheapest(costs).items()}

    def _cost(
        self, person: _Person, one: Shown, colours: FloatArray | None, stamp_ns: int
    ) -> float:
        """Return how far a figure is from a person: sum of squared deviations."""
        assert person.seen_ns is not None
        away_ns = abs(stamp_ns - person.seen_ns)
        if one.figure is None and person.estimate.posture is not None:
            # Free regions are not those of people who are tracked.
            return _OTHER
        # Unknown colours, such as those of a person in a grey image, agree with all.
        other = ALIKE / 2
        if colours is not None and person.colours is not None:
            other = apart(person.colours, colours)
        if away_ns > GONE_NS or one.figure is None or person.figure is None:
            return _OTHER * (other / ALIKE) ** 2
        deviation = _PLACE + _PLACE_PER_S * away_ns / 1e9
        return (other / _COLOURS) ** 2 + (person.figure.apart(one.figure) / deviation) ** 2

    def _new_people(
        self,
        shown: Sequence[Shown],
        colours: Sequence[FloatArray | None],
        found: dict[int, int],
    ) -> dict[int, int]:
        """Return the figures of people who are new, by number, and know them from now on."""
        others = [shown[number].pixels for number in found.values()]
        others += [p.pixels for p in self._people if p.pixels is not None and p.number not in found]
        taken = np.bitwise_or.reduce(others) if others else None
        free = []
        for number, one in enumerate(shown):
            is_clear = taken is None or _share(one.pixels, taken) < _MIXED
            is_certain = one.points is None or one.points.are_certain
            if number not in found.values() and is_clear and is_certain:
                free.append(number)
        waiting = [person for person in self._people if person.seen_ns is None]
        room = self._most - sum(person.seen_ns is not None for person in self._people)
        is_known = any(person.seen_ns is not None for person in self._people)
        self._new = self._new + 1 if free and room else 0
        if not free or room <= 0 or (is_known and self._new < _PROVED):
            return {}
        sizes = [np.count_nonzero(shown[number].pixels) for number in free]
        largest = sorted(free, key=lambda number: -sizes[free.index(number)])[:room]
        added = {}
        for number in sorted(largest, key=lambda number: _middle(shown[number].pixels)):
            person = waiting.pop(0) if waiting else self._add()
            person.colours = colours[number]
            added[person.number] = number
        self._new = 0
        return added

    def _see(self, person: _Person, one: Shown, colours: FloatArray | None, stamp_ns: int) -> None:
        if person.seen_ns is not None and stamp_ns - person.seen_ns > GONE_NS:
            person.tracker.reset()
            person.chance = _chance_of_same(person.colours, colours)
        person.points = one.points
        person.figure, person.pixels, person.seen_ns = one.figure, one.pixels, stamp_ns

    def _learn(self, person: _Person, colours: FloatArray | None) -> None:
        """Learn the colours of somebody whom nobody covers."""
        others = [p.pixels for p in self._people if p is not person and p.pixels is not None]
        assert person.pixels is not None
        if colours is None or (
            others and _share(person.pixels, np.bitwise_or.reduce(others)) > _LEARNS
        ):
            return
        if person.colours is None or len(person.colours) != len(colours):
            person.colours = colours
        person.colours = (1 - _LEARN_RATE) * person.colours + _LEARN_RATE * colours

    def _is_somebody_else(
        self, person: _Person, own: Silhouette | None, image: Image | None
    ) -> bool:
        """Return whether a tracker follows the region of another person, by the colours."""
        colours = None
        if own is not None and own.any():
            colours = _colours_of(Shown(None, None, own), image, own)
        if colours is None or person.colours is None:
            return False
        is_other = apart(person.colours, colours) > ALIKE
        person.others_images = person.others_images + 1 if is_other else 0
        return person.others_images >= _OTHERS_IMAGES

    def _shares(
        self, silhouette: Silhouette, seen: Container[int]
    ) -> Iterator[tuple[int, tuple[Silhouette, Silhouette]]]:
        """Yield each person's part of the silhouette, and the parts of others, by number.

        A pixel belongs to the nearest figure; in the figures of several, nobody knows whose it is.
        """
        there = [person for person in self._people if person.pixels is not None]
        if len(there) == 1:
            yield there[0].number, (silhouette, np.zeros_like(silhouette))
        if len(there) < 2:
            return
        away = []
        for person in there:
            assert person.pixels is not None
            # Who is not seen is behind the others.
            behind_px = 0.0 if person.number in seen else 0.5
            away.append(cv2.distanceTransform(255 - person.pixels, cv2.DIST_L2, 3) + behind_px)
        for number, person in enumerate(there):
            others = np.delete(away, number, axis=0).min(axis=0)
            own = np.where(away[number] < others, silhouette, np.uint8(0))
            yield person.number, (own, silhouette & ~own)

    def _tracked(
        self,
        person: _Person,
        seen: Observation,
        parts: tuple[Silhouette, Silhouette] | None,
        is_shown: bool,
        is_detected: bool,
    ) -> Estimate:
        """Return the estimate of a person with these :meth:`_shares`.

        Args:
            person: one of the people.
            seen: the whole observation.
            parts: the person's part of the silhouette, and that of others; None if unknown.
            is_shown: whether one of the figures is this person.
            is_detected: whether a detector finds the figures.
        """
        if person.seen_ns is None:
            return person.estimate
        assert self._last_ns is not None
        last, pixels, now_ns = person.estimate, person.pixels, self._last_ns
        one = seen.having(silhouette=np.zeros(self._shape, np.uint8), points=person.points)
        if parts is not None:
            own, covered = parts
            one = one.having(silhouette=own)
            if covered.any():
                one = one.having(covered=covered)
            if not is_shown and pixels is not None and _share(pixels, own) < _SEEN:
                others = (p.pixels for p in self._people if p is not person)
                shares = (_share(pixels, there) for there in others if there is not None)
                if max(shares, default=0.0) >= _HIDDEN:
                    return _held(last, hidden=True)
                if now_ns - person.seen_ns <= _DROPPED_NS:
                    return _held(last)
        if is_detected and now_ns - person.seen_ns > GONE_NS:
            # The rest of the silhouette is that of others: only an image of them brings them back.
            gone = Estimate(NO_PERSON if last.state == NO_PERSON else LOST)
            return replace(gone, person=person.number, person_chance=person.chance)
        found = replace(
            person.tracker.track(one), person=person.number, person_chance=person.chance
        )
        if found.posture is not None:
            person.fitted_ns = now_ns
            if not is_detected:
                person.seen_ns = now_ns
                if self._is_somebody_else(person, one.silhouette, seen.image):
                    person.tracker.reset()
                    return Estimate(NO_PERSON, person=person.number)
        elif is_shown and now_ns - person.fitted_ns <= _DROPPED_NS:
            return _held(last)
        return found


def _held(last: Estimate, hidden: bool = False) -> Estimate:
    """Return the last estimate for an image that does not show the person, or not well."""
    if last.posture is None:
        return last
    states: tuple[KeypointState, ...] = (KeypointState.HIDDEN,) * 6
    if not hidden and last.keypoint_states is not None:
        states = doubted(last.keypoint_states)
    legs = None if last.legs is None else last.legs.hidden()
    return replace(last, state=UNCERTAIN, keypoint_states=states, legs=legs)


def _figures(points: Sequence[ImagePoints], shape: tuple[int, ...]) -> list[Shown]:
    shown = []
    for one in points:
        figure = figure_of_points(one)
        if np.isfinite(figure.trunk_px):
            shown.append(Shown(one, figure, figure.drawn(shape)))
    return shown


def _share(pixels: Silhouette, of: Silhouette) -> float:
    """Return the share of the pixels (H, W) that are not 0 in ``of``."""
    return cv2.countNonZero(pixels & of) / max(cv2.countNonZero(pixels), 1)


def _middle(pixels: Silhouette) -> float:
    """Return the mean column of pixels that are not 0."""
    return float(np.nonzero(pixels)[1].mean())


def _colours_of(one: Shown, image: Image | None, silhouette: Silhouette) -> FloatArray | None:
    """Return the histogram of the trunk's colours, or brightness; None if it is not seen."""
    if image is None:
        return None
    if one.figure is None:
        rows = np.nonzero(one.pixels.any(axis=1))[0]
        trunk = one.pixels.copy()
        top, height = int(rows[0]), int(rows[-1] - rows[0])
        trunk[: top + height // 5] = trunk[top + height // 2 :] = 0
    else:
        trunk = one.figure.trunk(silhouette.shape)
    trunk &= silhouette
    return colours_in(image, trunk)


def _chance_of_same(before: FloatArray | None, now: FloatArray | None) -> float:
    """Return the probability that colours are those of one person; without them, it is even."""
    away = ALIKE if before is None or now is None else apart(before, now)
    return float(1.0 / (1.0 + np.exp((away - ALIKE) / _ALIKE_SPREAD)))


def _cheapest(costs: FloatArray) -> dict[int, int]:
    """Return the column of each row that has one below ``_OTHER``, with the least sum.

    A row without a column counts ``_OTHER``. The time grows with 2 to the number of rows.

    Args:
        costs: (N, M), of few rows.
    """
    best: dict[int, tuple[float, dict[int, int]]] = {0: (0.0, {})}
    for column in range(costs.shape[1]):
        for taken, (total, pairs) in list(best.items()):
            for row in np.flatnonzero(costs[:, column] < _OTHER).tolist():
                key, now = taken | 1 << row, total + float(costs[row, column]) - _OTHER
                if not taken >> row & 1 and (key not in best or now < best[key][0]):
                    best[key] = now, {**pairs, row: column}
    return min(best.values(), key=lambda one: one[0])[1]
