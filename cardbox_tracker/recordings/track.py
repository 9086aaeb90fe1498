"""``cardbox track``: track the posture in every image of a recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.recording import FrameSet, Recording
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.estimate import UNCERTAIN, Estimate
from cardbox_tracker.tracking.hands import HandReader, Look
from cardbox_tracker.tracking.people import People
from cardbox_tracker.tracking.tracker import Tracker

Observer = Callable[[RecordedFrame, Estimate, Tracker], None]
"""Callback that receives each image with its estimate and the tracker."""


@dataclass(frozen=True)
class TrackSummary:
    """Summary of a run.

    Attributes:
        frames: number of images.
        frames_tracked: number of images with a posture.
        mean_cost_px: mean cost over the tracked images; nan without any.
        mean_iou: mean overlap (IoU) over the tracked images; nan without any.
        frames_uncertain: number of tracked images whose posture may be wrong.
        remarks: warnings about extrinsics or depth that seem to be wrong.
        body: the body at the end, whose unknown values were fitted.
        scene: mean, deviation and origin of the camera's numbers by name.
        used: in how many images each optional input was used, by its name.
        accounts: for each camera, what was used of it and what was left out.
        assumptions: what the results rest on, with its numbers and where they are from.
        people: the same for each of several people by number; the numbers above are of all of them.
    """

    frames: int
    frames_tracked: int
    mean_cost_px: float
    mean_iou: float
    frames_uncertain: int = 0
    remarks: tuple[str, ...] = ()
    body: BodyModel | None = None
    accounts: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    scene: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)
    used: Mapping[str, int] = field(default_factory=dict)
    people: Mapping[int, TrackSummary] = field(default_factory=dict)

    @property
    def used_text(self) -> str:
        """The optional inputs and in how many images each was used; empty without any."""
        shares = (f"{name} in {count}" for name, count in self.used.items())
        text = ", ".join(shares)
        return f"used {text} of {self.frames} images" if text else ""


class Crowd(NamedTuple):
    """Several people to track.

    Attributes:
        bodies: see :class:`~cardbox_tracker.tracking.people.People`.
        most: number of people; None for all who come.
    """

    bodies: tuple[BodyModel, ...]
    most: int | None


class _Tally:
    """Counts the results of one person."""

    def __init__(self) -> None:
        self.frames = self.uncertain = 0
        self.costs: list[int] = []
        self.ious: list[float] = []

    def add(self, estimate: Estimate) -> None:
        self.frames += 1
        self.uncertain += estimate.state == UNCERTAIN
        if estimate.cost_px is not None and estimate.iou is not None:
            self.costs.append(estimate.cost_px)
            self.ious.append(estimate.iou)

    def summary(self, body: BodyModel, remarks: Sequence[str] = ()) -> TrackSummary:
        found = self.costs, self.ious
        cost_px, iou = (float(np.mean(one)) if one else float("nan") for one in found)
        counts = self.frames, len(self.costs)
        return TrackSummary(*counts, cost_px, iou, self.uncertain, tuple(remarks), body)


def track_recording(
    recording: Recording,
    body: BodyModel,
    config: TrackerConfig,
    seed: int,
    start_s: float,
    table: Path | None = None,
    observers: tuple[Observer, ...] = (),
    end_s: float = math.inf,
    crowd: Crowd | None = None,
    hands: Look | None = None,
) -> TrackSummary:
    """Track every image from ``start_s`` to ``end_s``.

    Args:
        recording: an open recording.
        body: the measured person.
        config: settings of the tracker.
        seed: random seed; the same recording and seed give the same bytes.
        start_s: seconds from the recording's start at which the person stands in the front
            reference posture.
        table: file to write with a row for each image, see :func:`~.result_table.result_table`.
        observers: called after each image, and for each of several people, such as a progress bar
            or a bag writer.
        end_s: seconds from the recording's start after which no image is tracked.
        crowd: people to track in place of ``body``, with the first camera alone.
        hands: finds the points of hands, which are then part of the estimates and the table.

    Raises:
        CardboxError: no image lies after ``start_s``, or a file cannot be written.
    """
    first, rng = recording.first, np.random.default_rng(seed)
    tallies: dict[int | None, tuple[_Tally, Tracker]] = {}
    if crowd is None:
        alone = Tracker(body, first.camera, config, rng, others=recording.others)
        track = partial(_track_one, alone)
    else:
        people = People(crowd.bodies, first.camera, config, rng, crowd.most)
        track = partial(_track_people, people)
    hand_readers: dict[int | None, HandReader] = {}
    has = first.has_points, crowd is not None, hands is not None
    with nullcontext() if table is None else result_table(table, *has) as add_row:
        frames = 0
        for taken in recording.frames(start_s, end_s):
            frames += 1
            for estimate, tracker in track(taken):
                tally, _ = tallies.setdefault(estimate.person, (_Tally(), tracker))
                tally.add(estimate)
                points = taken.first.points
                if estimate.person is not None:
                    points = people.points_of(estimate.person)
                person, time_s = (tracker.body, tracker.camera), taken.stamp_ns / 1e9
                if hands is not None:
                    hand_reader = hand_readers.setdefault(estimate.person, HandReader(hands))
                    picture = partial(first.full_picture, taken.first)
                    estimate = hand_reader.see(picture, points, estimate, *person, time_s)
                    is_seen = any(estimate.hands or ())
                    tracker.used["hands"] = tracker.used.get("hands", 0) + is_seen
                if add_row is not None:
                    roll_rad = tracker.body.camera_pose.roll_rad
                    add_row(taken.first, estimate.as_camera_stands(roll_rad))
                for observe in observers:
                    observe(taken.first, estimate, tracker)
                if tracker.agreement is not None and tracker.agreement.is_due:
                    tracker.agreement.check()
        if frames == 0:
            raise CardboxError(
                f"no image lies after --start {start_s:g} s; give seconds from its start"
            )
        recording.check_points()
    whole, remarks = _Tally(), list[str]()
    for tally, tracker in tallies.values():
        remarks += tracker.remarks
        if tracker.agreement is not None:
            tracker.agreement.check(is_last=True)
            remarks += tracker.agreement.remarks(recording.names[1:])
        whole.uncertain += tally.uncertain
        whole.costs += tally.costs
        whole.ious += tally.ious
        whole.frames += tally.frames
    each = {
        number: tally.summary(tracker.body)
        for number, (tally, tracker) in tallies.items()
        if number is not None
    }
    given = ("points", first.has_points), ("depth", recording.measures_depth)
    names = {f"camera {number}": name for number, name in enumerate(recording.names, 1)}
    used: dict[str, int] = {}
    if crowd is None:
        body = alone.body
        used = {name: 0 for name, is_given in given if is_given} | {
            names.get(name, name): count for name, count in alone.used.items()
        }
    # Of several people, there may be nobody.
    return replace(whole.summary(body, remarks), used=used, people=each)


def _track_one(tracker: Tracker, taken: FrameSet) -> list[tuple[Estimate, Tracker]]:
    return [(tracker.track(taken.observations), tracker)]


def _track_people(people: People, taken: FrameSet) -> list[tuple[Estimate, Tracker]]:
    return people.track(taken.observations[0], taken.people)
