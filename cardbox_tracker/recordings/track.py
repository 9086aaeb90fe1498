"""``cardbox track``: track the posture in every image of a recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.estimate import UNCERTAIN, Estimate
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
        used: in how many images each optional input was used, by its name.
        accounts: for each camera, what was used of it and what was left out.
        assumptions: what the results rest on, with its numbers and where they are from.
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
    used: Mapping[str, int] = field(default_factory=dict)

    @property
    def used_text(self) -> str:
        """The optional inputs and in how many images each was used; empty without any."""
        shares = (f"{name} in {count}" for name, count in self.used.items())
        text = ", ".join(shares)
        return f"used {text} of {self.frames} images" if text else ""


def track_recording(
    recording: Recording,
    body: BodyModel,
    config: TrackerConfig,
    seed: int,
    start_s: float,
    table: Path | None = None,
    observers: tuple[Observer, ...] = (),
    end_s: float = math.inf,
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
        observers: called after each image, such as a progress bar or a bag writer.
        end_s: seconds from the recording's start after which no image is tracked.

    Raises:
        CardboxError: no image lies after ``start_s``, or a file cannot be written.
    """
    rng = np.random.default_rng(seed)
    tracker = Tracker(body, recording.first.camera, config, rng, others=recording.others)
    costs: list[int] = []
    ious: list[float] = []
    frames = frames_uncertain = 0
    with (
        nullcontext() if table is None else result_table(table, recording.first.has_points)
    ) as add_row:
        for taken in recording.frames(start_s, end_s):
            estimate, frame = tracker.track(taken.observations), taken.first
            frames += 1
            frames_uncertain += estimate.state == UNCERTAIN
            if add_row is not None:
                add_row(frame, estimate)
            if estimate.cost_px is not None and estimate.iou is not None:
                costs.append(estimate.cost_px)
                ious.append(estimate.iou)
            for observe in observers:
                observe(frame, estimate, tracker)
            if tracker.agreement is not None and tracker.agreement.is_due:
                tracker.agreement.check()
        if frames == 0:
            raise CardboxError(
                f"no image lies after --start {start_s:g} s; give seconds from its start"
            )
        recording.check_points()
    mean = (float(np.mean(costs)), float(np.mean(ious))) if costs else (float("nan"),) * 2
    remarks = tracker.remarks
    if tracker.agreement is not None:
        tracker.agreement.check(is_last=True)
        remarks += tracker.agreement.remarks(recording.names[1:])
    given = ("points", recording.first.has_points), ("depth", recording.measures_depth)
    names = {f"camera {number}": name for number, name in enumerate(recording.names, 1)}
    used = {name: 0 for name, is_given in given if is_given} | {
        names.get(name, name): count for name, count in tracker.used.items()
    }
    return TrackSummary(
        frames, len(costs), *mean, frames_uncertain, tuple(remarks), tracker.body, used=used
    )
