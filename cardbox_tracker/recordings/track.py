"""``cardbox track``: track the posture in every image of a recording."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.scene import Scene
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import ROLL
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, SHOULDERS, KeypointState
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame, TimeSpan
from cardbox_tracker.search.doubt import HANDS
from cardbox_tracker.tracking.estimate import FILLED, LOST, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.session import Session, trackers_as_seen
from cardbox_tracker.tracking.smoother import OF_RECORDINGS, Smoother, Smoothing
from cardbox_tracker.tracking.tracker import Tracker

Observer = Callable[[RecordedFrame, Estimate, Tracker], None]
"""Callback that receives each image with its estimate and the tracker."""


@dataclass(frozen=True)
class TrackSummary:
    """Summary of a run."""

    frames: int  #: number of images
    frames_tracked: int  #: number of images with a posture
    mean_cost_px: float  #: mean cost over the tracked images; nan without any
    mean_iou: float  #: mean overlap (IoU) over the tracked images; nan without any
    frames_uncertain: int = 0  #: number of tracked images whose posture may be wrong
    remarks: tuple[str, ...] = ()  #: warnings about extrinsics or depth that seem to be wrong
    body: BodyModel | None = None  #: the body at the end, whose unknown values were fitted
    accounts: tuple[str, ...] = ()  #: for each camera, what was used of it and what was left out
    #: what the results rest on, with its numbers and where they are from.
    assumptions: tuple[str, ...] = ()
    scene: Scene | None = None  #: camera, floor and people
    #: poses of further cameras relative to the first one, by name
    cameras: Mapping[str, Extrinsics] = field(default_factory=dict)
    #: in how many images each optional input was used, by its name.
    used: Mapping[str, int] = field(default_factory=dict)
    quality: tuple[str, ...] = ()  #: see :meth:`Quality.lines`; empty for several people
    #: the same for each of several people by number; the numbers above are of all of them.
    people: Mapping[int, TrackSummary] = field(default_factory=dict)

    @property
    def used_text(self) -> str:
        """The optional inputs and in how many images each was used; empty without any."""
        shares = (f"{name} in {count}" for name, count in self.used.items())
        text = ", ".join(shares)
        return f"used {text} of {self.frames} images" if text else ""


def _summary(
    found: Sequence[Quality], body: BodyModel | None, remarks: Sequence[str] = ()
) -> TrackSummary:
    """Return the summary of one person, or of all of them together."""
    fits = [fit for one in found for fit in one.fits]
    cost_px, iou = (float(np.mean(x)) for x in zip(*fits, strict=True)) if fits else [math.nan] * 2
    images, uncertain = sum(one.images for one in found), sum(one.uncertain for one in found)
    lines = tuple(found[0].lines()) if len(found) == 1 else ()
    given = uncertain, tuple(remarks), body
    return TrackSummary(images, len(fits), cost_px, iou, *given, quality=lines)


def track_recording(
    recording: Recording,
    session: Session,
    span: TimeSpan,
    observers: Sequence[Observer] = (),
    smoothing: Smoothing = OF_RECORDINGS,
) -> TrackSummary:
    """Track every image of a span, in whose first one the person stands in the front posture.

    ``observers``, such as a table, a progress bar or a bag writer, are called for each image, and
    for each of several people. With ``only`` one of a session, the results are those of one person
    without a number. Raises CardboxError if no image lies in the span.
    """
    found, cuts_s, frames = list[Quality](), list[float](), 0
    smoother = Smoother[tuple[RecordedFrame, list[Tracker]]](smoothing)
    as_seen: list[Tracker] = []

    def tell(
        seen: Iterable[tuple[tuple[RecordedFrame, list[Tracker]], list[Estimate]]],
    ) -> None:
        for (frame, trackers), estimates in seen:
            for estimate, tracker, quality in zip(estimates, trackers, found, strict=False):
                quality(frame, estimate, tracker)
                for observe in observers:
                    observe(frame, estimate, tracker)

    for taken in recording.frames(*span):
        frames += 1
        if taken.first.is_cut and frames > 1:
            cuts_s.append(taken.time_s)
            tell(smoother.finish())
            smoother = Smoother(smoothing)
        estimates = session.track(taken.observations)
        if not session.is_several:
            estimates = [replace(one, person=None) for one in estimates]
        found += [Quality() for _ in estimates[len(found) :]]
        as_seen = trackers_as_seen(as_seen, session.trackers)
        image, of = (taken.first, as_seen), (tracker.body for tracker in as_seen)
        tell(smoother.add(image, taken.stamp_ns, estimates, of))
        session.check_cameras()
    tell(smoother.finish())
    if frames == 0:
        raise CardboxError(
            f"no image lies after --start {span.start_s:g} s; give seconds from its start"
        )
    faults = [source.points_fault for source in recording.sources]
    if all(faults):
        raise CardboxError(faults[0])
    session.check_cameras(is_last=True)
    bodies = [tracker.body for tracker in session.trackers]
    optional = ("points", recording.first.has_points), ("depth", recording.measures_depth)
    names = {f"camera {number}": name for number, name in enumerate(recording.names, 1)}
    used, each = dict[str, int](), dict[int, TrackSummary]()
    if not session.is_several:
        used = {name: 0 for name, is_given in optional if is_given} | {
            names.get(name, name): count for name, count in session.trackers[0].used.items()
        }
    else:
        pairs = zip(found, bodies, strict=True)
        each = {n: _summary([quality], body) for n, (quality, body) in enumerate(pairs, 1)}
    # Of several people, there may be nobody.
    body = bodies[0] if bodies else None
    remarks = session.remarks(recording.names, is_all=True)
    if cuts_s:
        remarks.insert(
            0,
            f"the film is cut at {', '.join(f'{one:.1f}' for one in cuts_s)} s: each time tracking "
            "starts anew, and people are known by the colours of the trunk alone, if several are "
            "told apart; pitch and height of the camera are those of the longest shot, so leans "
            "and places are right in that one: give --shots to track each by itself",
        )
    summary = _summary(found, body, remarks)
    return replace(summary, used=used, people=each)


_MOST_REASONS, _ELSEWHERE = 3, "hand may be elsewhere"
# Number of worst moments that are named.
_MOST_MOMENTS = 5
GAP_S = 3.0
"""Least time between two worst moments, s."""


class Quality:
    """Observer that counts the results of one person; see :meth:`lines`.

    Attributes:
        images: number of images.
        uncertain: number of images whose posture may be wrong.
        fits: cost, px, and overlap (IoU) of each image with a posture.
    """

    def __init__(self) -> None:
        self.images = self.uncertain = self._sure_hands = self._sure_places = 0
        self._sure = self._vertical = self._filled = 0
        self._reasons, self._pitch = Counter[str](), (0.0, 0.0)
        self._is_one_camera = True
        self.fits: list[tuple[int, float]] = []
        self._moments: list[tuple[float, int, tuple[float, str]]] = []
        self._angles_rad: list[float] = []
        self._hands_m: list[float] = []
        self._distances_m: list[float] = []
        # Chance that it is the same one of several people, and times, s, of each new one.
        self._chance, self._returns = 1.0, list[tuple[float, float]]()

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Count one image."""
        self.images += 1
        self._is_one_camera = len(tracker.cameras) == 1
        chance = estimate.person_chance
        if chance is not None and chance != self._chance:
            self._chance = chance
            self._returns.append((frame.time_s, chance))
        self.uncertain += estimate.state == UNCERTAIN
        if estimate.cost_px is not None and estimate.iou is not None:
            self.fits.append((estimate.cost_px, estimate.iou))
        self._sure += estimate.state == TRACKING
        self._filled += estimate.state == FILLED
        states = estimate.keypoint_states or ()
        sure = [states[hand] == KeypointState.TRACKED for hand in HANDS] if states else []
        self._sure_hands += sum(sure)
        place = estimate.place
        self._sure_places += place is not None and place.state == KeypointState.TRACKED
        self._vertical += estimate.vertical_state == KeypointState.TRACKED
        if estimate.pitch_stddev_rad is not None:
            self._pitch = tracker.body.camera_pose.pitch_rad, estimate.pitch_stddev_rad
        if estimate.state in (UNCERTAIN, LOST):
            self._reasons[estimate.reason or estimate.state] += 1
            chance, what = _moment(estimate)
            self._moments.append((chance, frame.stamp_ns, (frame.time_s, what)))
        if estimate.posture is None or estimate.posture_stddev is None:
            return
        self._angles_rad += estimate.posture_stddev[ROLL:].tolist()
        moved = estimate.posture + np.diag(estimate.posture_stddev)
        points_m = pose(tracker.body, np.vstack([estimate.posture, moved])).keypoints_m
        hands_m = points_m[:, HANDS] - points_m[:, SHOULDERS].mean(axis=1, keepdims=True)
        self._hands_m += np.linalg.norm(hands_m[1:] - hands_m[0], axis=(0, 2)).tolist()
        if place is not None:
            self._distances_m.append(float(place.stddev_m[0]))

    def lines(self) -> Iterator[str]:
        """Yield shares of what is sure, why the rest is not, deviations, and the worst moments.

        Hands, leans and distances are sure in the state ``tracked``. Typical is the median over
        images with a posture; a hand moves beside the shoulders with the deviations of all joints.
        """
        if not self.images:
            return
        yield (
            f"sure: the posture in {self._sure / self.images:.0%} of {self.images} images (hands "
            f"{self._sure_hands / (2 * self.images):.0%}), leans in "
            f"{self._vertical / self.images:.0%}, the distance (to 0.3 m) in "
            f"{self._sure_places / self.images:.0%}"
        )
        if self._filled:
            yield f"{self._filled} images without a posture are filled from those around them"
        if self._returns:
            returns = (f"{time_s:.1f} s ({chance:.0%})" for time_s, chance in self._returns)
            yield (
                "away or hidden, then known by the colours of the trunk alone, with the chance of "
                f"being the same person: {', '.join(returns)}"
            )
        if self._reasons:
            counts = (f"{why} ({count})" for why, count in self._reasons.most_common(_MOST_REASONS))
            yield f"postures are unsure where {', '.join(counts)}"
        if any(_ELSEWHERE in why for why in self._reasons):
            words = (
                "a posture is sure if all its joints are, so a hand can be sure where it is not: "
                "see left_hand_state and right_hand_state"
            )
            if self._is_one_camera:
                words += (
                    ". One camera hardly tells an arm towards it from one away from it: film more "
                    "from the front, or with a second camera"
                )
            yield words
        if self.fits and not self._vertical:
            pitch, stddev = np.degrees(self._pitch)
            yield (
                f"leans are unsure: the camera's pitch is {pitch:.0f} +- {stddev:.0f} degrees; "
                "give --camera-pitch-deg (0 for a level camera)"
            )
        if self._angles_rad:
            typical = [
                f"{np.degrees(np.median(self._angles_rad)):.0f} degrees of an angle",
                f"{100 * np.median(self._hands_m):.0f} cm of a hand beside the shoulders",
            ]
            if self._distances_m:
                typical.append(f"{100 * np.median(self._distances_m):.0f} cm of the distance")
            yield f"typical standard deviation: {', '.join(typical)}"
        if worst := sorted(worst_moments(self._moments, _MOST_MOMENTS)):
            moments = (f"{time_s:.1f} s ({what})" for time_s, what in worst)
            yield f"least sure, look at them: {', '.join(moments)}"


T = TypeVar("T")


def worst_moments(moments: Iterable[tuple[float, int, T]], most: int) -> list[T]:
    """Return up to ``most`` moments, of a badness and a stamp, ns, each, ``GAP_S`` or more apart.

    The worst one comes first, and the earlier one of equal ones.
    """
    found = list[tuple[float, int, T]]()
    for one in sorted(moments, key=lambda one: (-one[0], one[1])):
        if len(found) < most and all(abs(one[1] - other[1]) >= 1e9 * GAP_S for other in found):
            found.append(one)
    return [moment for *_, moment in found]


def _moment(estimate: Estimate) -> tuple[float, str]:
    """Return the chance that a posture is wrong, and what is doubtful."""
    states, chances = estimate.keypoint_states, estimate.keypoint_chances
    if states is None or chances is None:
        return 1.0, estimate.state
    doubtful = [
        KEYPOINT_NAMES[hand].replace("_", " ")
        for hand in HANDS
        if states[hand] in (KeypointState.UNCERTAIN, KeypointState.LOST)
    ]
    return float(np.max(chances)), " and ".join(doubtful) or "whole posture"
