"""One call for people, cameras and channels: one person before one camera is a list of one.

A session of one person gives all that the cameras show to one tracker. Unknown sizes are measured
beside it, in a few images; each new version of the body is tracked from its image on, with the
posture that was found so far. Of several people, each image shows a few *figures*: people whose
joints a detector has found, or regions of the silhouette that are apart. In each camera they are
assigned to the known people by place and by the colours of the trunk; in a further camera also by
where the lines of sight meet, and whom the camera has missed by the last posture. Somebody who has
left keeps the identity and is known by the colours alone. Each tracker gets the pixels that are
nearest to its person's figure. Pixels of others do not count for it, because they may hide the
person. Somebody whom others hide in all cameras stays where they were, and is ``uncertain``, with
``hidden`` keypoints.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from copy import copy
from dataclasses import dataclass, replace
from itertools import chain, combinations, repeat
from typing import NamedTuple

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import meeting_m
from cardbox_tracker.camera.tilt import tilted_body, tilted_states
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.health import Verdict
from cardbox_tracker.common.settings import all_of_kind, of_kind, settings_or
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import (
    ALIKE,
    DROPPED_NS,
    GONE_NS,
    KNOWN_IMAGES,
    OTHER,
    apart,
    cheapest,
    colours_in,
    learned,
    unlike,
)
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.people_camera import Distances
from cardbox_tracker.measuring.scene_camera import in_scene
from cardbox_tracker.measuring.scene_watch import SceneWatch
from cardbox_tracker.measuring.seen_body import SeenBody
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import PLACE, POSTURE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import TrackerConfig, default_preset
from cardbox_tracker.search.doubt import doubted
from cardbox_tracker.terms.term import USUAL_INTERVAL_S, Image, Silhouette
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, UNCERTAIN, Estimate
from cardbox_tracker.tracking.hands import Look
from cardbox_tracker.tracking.observation import Observation, Observations, listed, stamp_of
from cardbox_tracker.tracking.tracker import Tracker

MOST_PEOPLE = 6
"""People that are tracked if their number is not given."""

# Images without anybody after which another person is measured.
_EMPTY_IMAGES = 5
# Change of that distance that changes the odds of being the same person by a factor of e.
_ALIKE_SPREAD = 0.07
# Share of a figure that others may cover when its colours are learned.
_LEARNS = 0.1
# Share of a figure in those of others from which it is hidden, and from which it is a mere mixture.
_HIDDEN, _MIXED = 0.15, 0.5
# Least share of a figure in the silhouette by which somebody is tracked whom the detector misses.
_SEEN = 0.4
# Time for which a hidden person stays where they were, ns.
_HELD_NS = 3_000_000_000
# Relative difference of statures up to which they are the same.
_SAME_STATURE = 0.08
# Images in a row in which somebody new is seen before they are tracked, after the first images.
_PROVED = 3
# Least area and height of the region of a new person, as shares of the image.
_LEAST_AREA, _LEAST_HEIGHT = 0.01, 0.25
# Deviation of the gap between lines of sight to the middle of a trunk, m; length of a trunk, m, and
# relative deviation of that which the place where they meet gives.
_GAP_M, _TRUNK_M, _TRUNK = 0.15, 0.5, 0.4


class Shown(NamedTuple):
    """A figure in one image."""

    points: ImagePoints | None  #: joints from a detector; None for a region of the silhouette
    figure: Figure | None  #: place and size; None for a region
    pixels: Silhouette  #: (H, W), 255 at the person's pixels as far as they are known, else 0


class _Share(NamedTuple):
    """What a camera shows of a person."""

    seen: Observation  #: the observation with the person's part of the silhouette
    is_found: bool  #: whether one of the figures is the person
    is_missed: bool  #: whether the person is where the silhouette shows nothing of them
    is_hidden: bool  #: whether others hide the person there
    is_detected: bool  #: whether a detector finds the figures


@dataclass
class _Sight:
    """What is known of a person in the images of one camera."""

    figure: Figure | None = None
    points: ImagePoints | None = None
    pixels: Silhouette | None = None
    colours: FloatArray | None = None
    learned: int = 0
    seen_ns: int | None = None


class _Person:
    """One identity, whose body is measured unless it is known."""

    def __init__(self, number: int | None, tracker: Tracker, measuring: SeenBody | None) -> None:
        self.number, self.tracker, self._measuring = number or 1, tracker, measuring
        self.estimate = Estimate(NO_PERSON, person=number)
        self.sights = [_Sight() for _ in tracker.cameras]
        self.fitted_ns, self.others = 0, Verdict("other person")
        self.chance = 1.0

    def track(
        self, observations: Observations, time_s: float, only_measures: bool = False
    ) -> Estimate:
        """Return the estimate by the newest version of the body, which these images may show."""
        tracker, measuring = self.tracker, self._measuring
        if measuring is None:
            return Estimate(LOST) if only_measures else tracker.track(observations)
        frames = tracker.frames(observations)
        first = frames[0]
        is_new_start = bool(measuring.body.unknown) or self.estimate.posture is None
        if measuring.see(first.silhouette, first.image, time_s, first.points):
            tracker.use(measuring.body, first.stamp_ns, is_new_start)
            frames = tracker.again(frames)
        if only_measures:
            return Estimate(LOST)
        estimate = tracker.follow(frames)
        if tracker.empty == _EMPTY_IMAGES:
            # The next one may be somebody else, and stand elsewhere.
            measuring.forget()
            if not tracker.body.unknown:
                tracker.use(measuring.body, first.stamp_ns, is_new_start=True)
        return estimate

    def tilt(self, guess: BodyModel, stamp_ns: int) -> None:
        """See :meth:`Session.tilt`."""
        before, last, state = self.tracker.body, self.estimate, self.state()
        self.tracker.use(tilted_body(before, guess.camera_pose), stamp_ns)
        if self._measuring is not None:
            self._measuring.tilt(guess)
        if state is not None:
            (state,) = tilted_states(state[None], before, self.tracker.body)
            offset_m = None if last.offset_m is None else state[PLACE]
            self.estimate = replace(last, posture=state[POSTURE], offset_m=offset_m)

    def correct(self, far: Distances | None, stamp_ns: int) -> None:
        """Go on with the scale by the distances, m, of somebody who is measured."""
        if self._measuring is not None and self._measuring.correct(far):
            self.tracker.use(self._measuring.body, stamp_ns)

    @property
    def seen_ns(self) -> int | None:
        """Time at which a camera last showed the person; None before."""
        return max((one.seen_ns for one in self.sights if one.seen_ns is not None), default=None)

    def state(self) -> FloatArray | None:
        """Return the last state (14,); None without one."""
        found = self.estimate
        if found.posture is None:
            return None
        return np.append(found.posture, np.zeros(2) if found.offset_m is None else found.offset_m)

    def drawn(self, camera: int) -> Silhouette | None:
        """Return the pixels (H, W) of the last posture in a camera; None without one."""
        state = self.state()
        return None if state is None else self.tracker.cameras[camera].drawn(state)

    def expected(self, camera: int) -> Figure | None:
        """Return the figure of the last posture in a camera; None without one."""
        state = self.state()
        return None if state is None else self.tracker.cameras[camera].figure(state)


class Session:
    """Tracks up to six people before up to four cameras, by default with the preset ``default``.

    Attributes:
        is_several: whether estimates are of several people, each with a number.
    """

    def __init__(
        self,
        bodies: Sequence[BodyModel],
        camera: Camera,
        config: TrackerConfig | None = None,
        rng: np.random.Generator | None = None,
        others: Sequence[OtherCamera] = (),
        people: int | None = None,
        look: Look | None = None,
        beside: Executor | None = None,
        only_measures: bool = False,
        scene: SceneWatch | None = None,
        only: int | None = None,
    ) -> None:
        """Set up for people who may come, with the body of each in the order of their numbers.

        The last body is also that of further people; they are numbered as they come, and from left
        to right if they come together. ``people`` is their number, 0 for up to ``MOST_PEOPLE``;
        None for one without a number, to whom everything belongs that the cameras show. Unknown
        values of a body are measured, see :class:`~cardbox_tracker.measuring.seen_body.SeenBody`;
        ``beside`` does so while tracking goes on, and with ``only_measures`` nobody is tracked.
        ``scene`` finds the camera and people's distances meanwhile, and bodies follow it. ``only``
        is the number of the one person whose estimate is given; the others are only told apart. The
        other arguments are those of :class:`~.tracker.Tracker`.

        Raises what a tracker does, and ValueError if there is no body, or another number of people.
        """
        known = all_of_kind("bodies", bodies, BodyModel)
        others = all_of_kind("others", others, OtherCamera)
        if not known:
            raise ValueError("bodies are empty; expected the body of each person, or one for all")
        for name, number in (("people", people), ("only", only)):
            if number is not None and not 0 <= of_kind(name, number, int) <= MOST_PEOPLE:
                raise ValueError(f"{name} is {number}; expected a number up to {MOST_PEOPLE}")
        meeting = meeting_m([other.extrinsics for other in others])
        # All cameras look at a body at an unknown distance.
        self._bodies = tuple(
            body.with_values(distance_m=meeting)
            if meeting is not None and "distance_m" in body.unknown
            else body
            for body in known
        )
        self._camera = of_kind("camera", camera, Camera)
        self.config = settings_or(default_preset(), config)
        self._rng, self._others = settings_or(np.random.default_rng(0), rng, "rng"), others
        self._look, self._is_alone, self._beside = look, people is None, beside
        self._only_measures, self._most = only_measures, people or MOST_PEOPLE
        self._scene = None if scene is None else of_kind("scene", scene, SceneWatch)
        self._only, self.is_several = only, people is not None and only is None
        self._people: list[_Person] = []
        # What the first camera's last image shows of each person, by number.
        self._seen: dict[int, _Share] = {}
        # Images in a row with somebody new, by camera.
        self._new = [0] * (1 + len(self._others))
        # Of several people, what the joints of all say of each further camera.
        self._joints = [Verdict("joints") for _ in self._others]
        self._last_ns: int | None = None
        self._checked: Future[None] | None = None
        for number in [None] if people is None else range(1, max(people, only or 0) + 1):
            self._add(number)

    def _add(self, number: int | None) -> _Person:
        body = self._bodies[min(number or 1, len(self._bodies)) - 1]
        rng = self._rng if number is None else self._rng.spawn(1)[0]
        measuring = None
        if body.unknown:
            # The paper's filter cannot go on with another version of a body.
            pause_s = 1.0 if self.config.has_several_views else np.inf
            camera = self._camera.with_pitch(body.camera_pose.pitch_rad)
            fits = rng.spawn(1)[0]
            measuring = SeenBody(body, camera, self.config, fits, pause_s, self._beside)
        given = body, self._camera, self.config, rng
        tracker = Tracker(*given, others=self._others, look=self._look)
        self._people.append(_Person(number, tracker, measuring))
        return self._people[-1]

    @property
    def _given(self) -> list[_Person]:
        """The people whose estimates are given."""
        return [one for one in self._people if self._only in (None, one.number)]

    @property
    def trackers(self) -> list[Tracker]:
        """The tracker of each person, in the order of the estimates."""
        return [person.tracker for person in self._given]

    @property
    def agreement(self) -> CameraAgreement | None:
        """Check of the extrinsics, by the first person; None with one camera."""
        return self._people[0].tracker.agreement if self._people else None

    def check_cameras(self, is_last: bool = False) -> None:
        """Estimate the rotation of further cameras if it is due, see :class:`.CameraAgreement`.

        While images come, an executor ``beside`` does it.
        """
        agreement = self.agreement
        if agreement is None or not (agreement.is_due or is_last):
            return
        if self._beside is None or is_last:
            agreement.check(is_last)
        elif self._checked is None or self._checked.done():
            if self._checked is not None:
                self._checked.result()
            self._checked = self._beside.submit(agreement.check)

    def remarks(self, names: Sequence[str], is_all: bool = False) -> list[str]:
        """Return warnings about images that contradict each other; ``is_all`` adds past ones."""
        told = [text for one in self.trackers for text in one.remarks(names, is_all)]
        told += self._exchanged_statures()
        pairs = zip(names[1:], self._joints, strict=False)
        told += [one.remark(name=name) for name, one in pairs if one.holds]
        told += () if self._scene is None else self._scene.remarks
        if self.agreement is not None:
            told += self.agreement.remarks(names[1:])
        return list(dict.fromkeys(told))

    def _exchanged_statures(self) -> Iterator[str]:
        """Yield which two people are as tall as each other's stature."""
        shown = [(one.number, one.tracker.arm_m, one.tracker.place.scale) for one in self._given]
        for (one, own_m, own), (two, other_m, other) in combinations(shown, 2):
            is_own = abs(own * own_m / other_m - 1.0) < _SAME_STATURE < abs(own - 1.0)
            if is_own and abs(other * other_m / own_m - 1.0) < _SAME_STATURE:
                yield (
                    f"person {one} is as tall as person {two} is given, and the other way round: "
                    "exchange their statures, which count from left to right if people come "
                    "together, else as they come"
                )

    def shown(self) -> dict[int, Shown]:
        """Return the figures in the first camera's last image by the numbers of several people."""
        sights = {number: self._people[number - 1].sights[0] for number in self._seen}
        return {
            number: Shown(sight.points, sight.figure, sight.pixels)
            for number, sight in sights.items()
            if self._seen[number].is_found and sight.pixels is not None
        }

    def silhouette_of(self, number: int) -> Silhouette | None:
        """Return the part of the first camera's last silhouette that is one of several people's."""
        return self._seen[number].seen.silhouette if number in self._seen else None

    def points_of(self, number: int) -> ImagePoints | None:
        """Return the points of one of several people in the first camera's last image."""
        return self._people[number - 1].sights[0].points

    def reset(self, number: int = 1) -> None:
        """Forget the posture of a person, who keeps the number."""
        person = self._people[number - 1]
        person.tracker.reset()
        person.estimate = Estimate(NO_PERSON, person=person.estimate.person)

    def tilt(self, bodies: Sequence[BodyModel], stamp_ns: int) -> None:
        """Go on before the same camera with the pitch of ``bodies``, from the image of a stamp on.

        Each person keeps number, sizes and place in the image, see :meth:`.Tracker.use`.
        ``bodies`` are those that were given, with the other pitch.
        """
        self._bodies = tuple(bodies)
        for person in self._people:
            person.tilt(bodies[min(person.number, len(bodies)) - 1], stamp_ns)

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from now on; return whether tracking starts again, see Tracker."""
        self.config = of_kind("config", config, TrackerConfig)
        restarted = [tracker.configure(config) for tracker in self.trackers]
        return any(restarted)

    def track(self, observations: Observations | Observation | Silhouette) -> list[Estimate]:
        """Estimate the postures of all people at one time, in the order of their numbers.

        Of several people, silhouettes show all of them, and the channel ``people`` has the joints
        of each whom a detector finds; without it there is no detector. Takes and raises what
        :meth:`.Tracker.track` does.
        """
        observations = listed(observations, 1 + len(self._others))
        stamp_ns = stamp_of(observations)
        if stamp_ns is None:
            stamp_ns = 0 if self._last_ns is None else self._last_ns + round(1e9 * USUAL_INTERVAL_S)
        self._last_ns = stamp_ns
        first = observations[0]
        if first is not None and first.is_cut:
            self._start_anew()
        if self._is_alone:
            (person,) = self._people
            self._look_around(first, [None if first is None else first.points])
            person.estimate = person.track(observations, stamp_ns / 1e9, self._only_measures)
            return [person.estimate]
        seen = [self._shared(*one) for one in enumerate(observations)]
        self._seen = seen[0]
        self._look_around(first, [person.sights[0].points for person in self._people])
        # Only the figures of a detector in one camera tell people apart without their postures.
        is_told = not self._others and first is not None and "people" in first.channels
        for person in self._given if is_told else self._people:
            person.estimate = self._tracked(person, [one.get(person.number) for one in seen])
        found = [person.estimate for person in self._given]
        return [one.contradicted() for one in found] if self._are_contradicted() else found

    def _are_contradicted(self) -> bool:
        """Return whether a further camera contradicts the first one, by all people's joints.

        Those of one person may be guessed, or be somebody else's, where others hide them.
        """
        shown = [one.take_joints() for person in self._people if (one := person.tracker.agreement)]
        for verdict, angles in zip(self._joints, zip(*shown, strict=True), strict=False):
            if known := [angle_deg for angle_deg in angles if angle_deg is not None]:
                verdict.see(min(known))
        return any(one.holds or one.is_suspected for one in self._joints)

    def _start_anew(self) -> None:
        """Forget all places, so that people are known by their colours alone."""
        assert self._last_ns is not None
        for person in self._people:
            self.reset(person.number)
            for sight in person.sights:
                sight.points = sight.pixels = None
                if sight.seen_ns is not None:
                    sight.seen_ns = self._last_ns - GONE_NS - 1

    def _look_around(self, seen: Observation | None, points: Sequence[ImagePoints | None]) -> None:
        """Use what the first camera shows of the scene, with the points of each person."""
        if self._scene is None or seen is None:
            return
        assert self._last_ns is not None
        found = self._scene.see(self._last_ns / 1e9, points, seen.image)
        if found is None:
            return
        bodies = (in_scene(body, found.camera, moves=found.moves) for body in self._bodies)
        self.tilt([*bodies], self._last_ns)
        for person, far in zip(self._people, found.distances, strict=False):
            stature_m = self._scene.stature_m(person.number)
            there = far and far._replace(distances=far.distances * stature_m)
            person.correct(there, self._last_ns)

    def _shared(self, camera: int, seen: Observation | None) -> dict[int, _Share]:
        """Return what a camera shows of each person, by number."""
        assert self._last_ns is not None
        if seen is None or seen.silhouette is None:
            return {}
        silhouette, stamp_ns, given = seen.silhouette, self._last_ns, seen.channels.get("people")
        is_detected = given is not None
        if given is not None:
            shown = _figures(given, silhouette.shape)
        else:
            shown = self._regions(camera, silhouette)
        colours = [_colours_of(one, seen.image, silhouette) for one in shown]
        found = self._assigned(camera, shown, colours)
        found |= self._new_people(camera, shown, colours, found)
        for person in self._people:
            sight = person.sights[camera]
            if person.number in found:
                number = found[person.number]
                self._see(person, camera, shown[number], colours[number])
                continue
            sight.points = None
            elsewhere = person.seen_ns == stamp_ns
            if not is_detected or elsewhere:
                sight.pixels = person.drawn(camera)
            last_ns = sight.seen_ns
            if not elsewhere and last_ns is not None and not 0 <= stamp_ns - last_ns <= _HELD_NS:
                sight.pixels = None
        for person in self._people:
            if person.number in found:
                self._learn(person, camera, colours[found[person.number]])
        parts = dict(self._shares(camera, silhouette, found.keys()))
        return {
            person.number: self._share_of(person, camera, seen, parts, person.number in found)
            for person in self._people
        }

    def _regions(self, camera: int, silhouette: Silhouette) -> list[Shown]:
        """Return the regions of a silhouette that nobody who is known occupies."""
        drawn = [pixels for p in self._people if (pixels := p.drawn(camera)) is not None]
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
        self, camera: int, shown: Sequence[Shown], colours: Sequence[FloatArray | None]
    ) -> dict[int, int]:
        """Return which figure each known person is, by number."""
        known = [person for person in self._people if person.seen_ns is not None]
        pairs = list(zip(shown, colours, strict=True))
        costs = [[self._cost(person, camera, *pair) for pair in pairs] for person in known]
        return {known[row].number: column for row, column in cheapest(costs).items()}

    def _cost(self, person: _Person, camera: int, one: Shown, colours: FloatArray | None) -> float:
        """Return how far a figure is from a person: sum of squared deviations."""
        assert person.seen_ns is not None and self._last_ns is not None
        if one.figure is None and person.estimate.posture is not None:
            # Free regions are not those of people who are tracked.
            return OTHER
        sight = person.sights[camera]
        before, seen_ns = sight.figure, sight.seen_ns
        if seen_ns != person.seen_ns and (seen_ns is None or self._last_ns - seen_ns > DROPPED_NS):
            # Another camera has seen the person since.
            before, seen_ns = person.expected(camera), person.fitted_ns
        away_ns = abs(self._last_ns - (seen_ns or 0))
        # Those of somebody who comes in are not sure, but all that is left of who has gone.
        is_known = sight.learned >= KNOWN_IMAGES or away_ns > GONE_NS
        known = sight.colours if is_known else None
        away = unlike(before, known, one.figure, colours, away_ns)
        return away + self._gap(person, camera, one)

    def _gap(self, person: _Person, camera: int, one: Shown) -> float:
        """Return how far a figure is from those in other cameras: sum of squared deviations."""
        total = 0.0
        for number, sight in enumerate(person.sights):
            if sight.seen_ns != self._last_ns or number == camera:
                continue
            if sight.figure is None or one.figure is None:
                continue
            here = self._sight_line(camera, one.figure)
            there = self._sight_line(number, sight.figure)
            ahead = np.column_stack([here[1], -there[1]])
            between = there[0] - here[0]
            depths_m = np.linalg.lstsq(ahead, between, rcond=None)[0]
            trunks_m = np.maximum(depths_m, 1e-3) * [here[2], there[2]]
            sizes = np.log(trunks_m / _TRUNK_M) / _TRUNK
            total += float(np.sum(((ahead @ depths_m - between) / _GAP_M) ** 2) + sizes @ sizes)
        return total

    def _sight_line(self, camera: int, figure: Figure) -> tuple[FloatArray, FloatArray, float]:
        """Return place and direction of a line of sight, and the trunk's angle.

        Both are in the first optical frame; the direction has the length of a metre of depth.
        """
        one = self._others[camera - 1].camera if camera else self._camera
        (column, row), trunk = figure.middle_px, figure.trunk_px / one.fx
        ahead = np.array([(column - one.cx) / one.fx, (row - one.cy) / one.fy, 1.0])
        if not camera:
            return np.zeros(3), ahead, trunk
        pose = self._others[camera - 1].extrinsics
        return -pose.translation_m @ pose.rotation, ahead @ pose.rotation, trunk

    def _new_people(
        self,
        camera: int,
        shown: Sequence[Shown],
        colours: Sequence[FloatArray | None],
        found: dict[int, int],
    ) -> dict[int, int]:
        """Return the figures of people who are new, by number, and know them from now on."""
        sights = [p.sights[camera] for p in self._people if p.number not in found]
        others = [shown[number].pixels for number in found.values()]
        others += [sight.pixels for sight in sights if sight.pixels is not None]
        taken = np.bitwise_or.reduce(others) if others else None
        free = []
        for number, one in enumerate(shown):
            is_clear = taken is None or _share(one.pixels, taken) < _MIXED
            is_certain = one.points is None or one.points.are_certain
            # Who comes in at a side is new once half of the trunk is in the image.
            column_px = 0.0 if one.figure is None else one.figure.middle_px[0]
            is_in = 0.0 <= column_px < one.pixels.shape[1]
            if number not in found.values() and is_clear and is_certain and is_in:
                free.append(number)
        waiting = [person for person in self._people if person.seen_ns is None]
        room = self._most - (len(self._people) - len(waiting))
        is_known = len(waiting) < len(self._people)
        self._new[camera] = self._new[camera] + 1 if free and room else 0
        if not free or room <= 0 or (is_known and self._new[camera] < _PROVED):
            return {}
        sizes = [np.count_nonzero(shown[number].pixels) for number in free]
        largest = sorted(free, key=lambda number: -sizes[free.index(number)])[:room]
        added = {}
        for number in sorted(largest, key=lambda one: np.nonzero(shown[one].pixels)[1].mean()):
            person = waiting.pop(0) if waiting else self._add(len(self._people) + 1)
            person.sights[camera].colours = colours[number]
            added[person.number] = number
        self._new[camera] = 0
        return added

    def _see(self, person: _Person, camera: int, one: Shown, colours: FloatArray | None) -> None:
        assert self._last_ns is not None
        sight = person.sights[camera]
        if person.seen_ns is not None and self._last_ns - person.seen_ns > GONE_NS:
            person.tracker.reset()
            person.chance = _chance_of_same(sight.colours, colours)
        sight.points, sight.figure, sight.pixels = one.points, one.figure, one.pixels
        sight.seen_ns = self._last_ns

    def _learn(self, person: _Person, camera: int, colours: FloatArray | None) -> None:
        """Learn the colours of somebody whom nobody covers."""
        sight = person.sights[camera]
        assert sight.pixels is not None
        if colours is None or self._share_of_others(person, camera, sight.pixels) > _LEARNS:
            return
        sight.colours = learned(sight.colours, colours)
        sight.learned += 1

    def _share_of_others(self, person: _Person, camera: int, pixels: Silhouette) -> float:
        """Return the share of a person's pixels that are also those of others."""
        sights = [one.sights[camera] for one in self._people if one is not person]
        others = [sight.pixels for sight in sights if sight.pixels is not None]
        return _share(pixels, np.bitwise_or.reduce(others)) if others else 0.0

    def _is_somebody_else(self, person: _Person, seen: Observation) -> bool:
        """Return whether a tracker follows the region of another person, by the colours."""
        own, colours, known = seen.silhouette, None, person.sights[0].colours
        if own is not None and own.any():
            colours = _colours_of(Shown(None, None, own), seen.image, own)
        if colours is None or known is None:
            return False
        return person.others.count(apart(known, colours) > ALIKE)

    def _shares(
        self, camera: int, silhouette: Silhouette, seen: Container[int]
    ) -> Iterator[tuple[int, tuple[Silhouette, Silhouette]]]:
        """Yield each person's part of the silhouette, and the parts of others, by number.

        A pixel belongs to the nearest figure; in the figures of several, nobody knows whose it is.
        """
        there = [
            (person.number, pixels)
            for person in self._people
            if (pixels := person.sights[camera].pixels) is not None
        ]
        if len(there) == 1:
            yield there[0][0], (silhouette, np.zeros_like(silhouette))
        if len(there) < 2:
            return
        away = []
        for number, pixels in there:
            # Who is not seen is behind the others.
            behind_px = 0.0 if number in seen else 0.5
            away.append(cv2.distanceTransform(255 - pixels, cv2.DIST_L2, 3) + behind_px)
        for row, (number, _) in enumerate(there):
            others = np.delete(away, row, axis=0).min(axis=0)
            own = np.where(away[row] < others, silhouette, np.uint8(0))
            yield number, (own, silhouette & ~own)

    def _share_of(
        self,
        person: _Person,
        camera: int,
        seen: Observation,
        parts: Mapping[int, tuple[Silhouette, Silhouette]],
        is_found: bool,
    ) -> _Share:
        """Return what a camera shows of a person with these :meth:`_shares`."""
        assert seen.silhouette is not None
        pixels, nothing = person.sights[camera].pixels, np.zeros(seen.silhouette.shape, np.uint8)
        own, covered = parts.get(person.number, (nothing, nothing))
        if "covered" in seen.channels:
            covered = covered | seen.channels["covered"]
        more = {"covered": covered} if covered.any() else {}
        points = person.sights[camera].points
        one = seen.having(silhouette=own, points=points, people=None, **more)
        is_missed = is_hidden = False
        if not is_found and pixels is not None and _share(pixels, own) < _SEEN:
            is_missed = True
            is_hidden = self._share_of_others(person, camera, pixels) >= _HIDDEN
        is_detected = "people" in seen.channels
        return _Share(one, is_found, is_missed, is_hidden, is_detected)

    def _tracked(self, person: _Person, shares: Sequence[_Share | None]) -> Estimate:
        """Return the estimate of a person of whom each camera shows this."""
        seen_ns, now_ns, last = person.seen_ns, self._last_ns, person.estimate
        there = [one for one in shares if one is not None]
        if seen_ns is None or not there:
            return _held(last)
        assert now_ns is not None
        if all(one.is_missed for one in there):
            if any(one.is_hidden for one in there):
                return _held(last, hidden=True)
            if now_ns - seen_ns <= DROPPED_NS:
                return _held(last)
        is_detected = any(one.is_detected for one in there)
        is_gone = last.posture is None or now_ns - seen_ns > GONE_NS
        if is_detected and is_gone and not any(one.is_found for one in there):
            # The rest of the silhouette is that of others: only an image of them brings them back.
            gone = Estimate(NO_PERSON if last.state == NO_PERSON else LOST)
            return replace(gone, person=person.number, person_chance=person.chance)
        # A camera that misses the person, whom another one shows, tells nothing.
        least = min(one.is_missed for one in there)
        used = [one is not None and one.is_missed == least for one in shares]
        given = [
            one.seen if one is not None and is_used else Observation(stamp_ns=now_ns)
            for one, is_used in zip(shares, used, strict=True)
        ]
        found = person.track(given, now_ns / 1e9, self._only_measures)
        found = replace(found, person=person.number, person_chance=person.chance)
        if found.posture is not None:
            person.fitted_ns = now_ns
            if not is_detected:
                for sight, is_used in zip(person.sights, used, strict=False):
                    sight.seen_ns = now_ns if is_used else sight.seen_ns
                if self._is_somebody_else(person, there[0].seen):
                    person.tracker.reset()
                    return Estimate(NO_PERSON, person=person.number)
        elif any(one.is_found for one in there) and now_ns - person.fitted_ns <= DROPPED_NS:
            return _held(last)
        return found


def _held(last: Estimate, hidden: bool = False) -> Estimate:
    """Return the last estimate for an image that does not show the person, or not well."""
    if last.posture is None:
        return last
    hands = None if last.hands is None else (None, None)
    states: tuple[KeypointState, ...] = (KeypointState.HIDDEN,) * 6
    if not hidden and last.keypoint_states is not None:
        states = doubted(last.keypoint_states)
    legs = None if last.legs is None else last.legs.hidden()
    reason = "others hide the person" if hidden else "the person is not seen for a moment"
    last = replace(last, state=UNCERTAIN, reason=reason)
    return replace(last, keypoint_states=states, legs=legs, hands=hands)


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


def _colours_of(one: Shown, image: Image | None, silhouette: Silhouette) -> FloatArray | None:
    """Return the histogram of the trunk's colours, or brightness; None if it is not seen."""
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


def trackers_as_seen(before: Sequence[Tracker], now: Iterable[Tracker]) -> list[Tracker]:
    """Return trackers that keep the body of an image; a copy of each that has got another one.

    Args:
        before: what this function returned for the image before.
        now: the trackers of the session.
    """
    both = zip(now, chain(before, repeat(None)), strict=False)
    return [a if a is not None and a.body is b.body else copy(b) for b, a in both]
