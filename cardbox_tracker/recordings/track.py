"""``cardbox track``: track the posture in every image of a recording."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import save_body_model
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.estimate import UNCERTAIN
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.recordings.overlay_video import overlay_video
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.result_bag import Observer, result_bag
from cardbox_tracker.recordings.result_table import result_table


class TrackFiles(NamedTuple):
    """Files to write; None for one that is not wanted.

    Attributes:
        table: one row for each image, see :func:`~.result_table.result_table`.
        video: overlay video, at the rate and the resolution of the recording.
        bag: folder of a bag with the topics of the tracker.
        body: the body at the end of the recording.
    """

    table: Path | None = None
    video: Path | None = None
    bag: Path | None = None
    body: Path | None = None


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
    """

    frames: int
    frames_tracked: int
    mean_cost_px: float
    mean_iou: float
    frames_uncertain: int = 0
    remarks: tuple[str, ...] = ()
    body: BodyModel | None = None


def track_recording(
    recording: Recording,
    body: BodyModel,
    config: TrackerConfig,
    seed: int,
    start_s: float,
    files: TrackFiles | None = None,
    observers: tuple[Observer, ...] = (),
    overwrite: bool = False,
) -> TrackSummary:
    """Track every image from ``start_s`` on.

    Args:
        recording: an open recording.
        body: the measured person.
        config: settings of the tracker.
        seed: random seed; the same recording and seed give the same bytes.
        start_s: seconds from the recording's start at which the person stands in the front
            reference posture.
        files: files to write, each atomically; None for none.
        observers: called after each image, such as a progress bar.
        overwrite: whether an existing bag is replaced.

    Raises:
        CardboxError: no image lies after ``start_s``, or a file cannot be written.
    """
    files = files or TrackFiles()
    rng = np.random.default_rng(seed)
    tracker = Tracker(body, recording.first.camera, config, rng, others=recording.others)
    costs: list[int] = []
    ious: list[float] = []
    frames = frames_uncertain = 0
    with ExitStack() as stack:
        add_row = None
        if files.table is not None:
            add_row = stack.enter_context(result_table(files.table, recording.first.has_points))
        if files.bag is not None:
            bag = result_bag(files.bag, recording.first.frame_id, overwrite)
            observers = (stack.enter_context(bag), *observers)
        if files.video is not None:
            video = stack.enter_context(overlay_video(files.video, recording))
            observers = (video, *observers)
        for taken in recording.frames(start_s):
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
    mean = (float(np.mean(costs)), float(np.mean(ious))) if costs else (float("nan"),) * 2
    remarks = tracker.remarks
    if tracker.agreement is not None:
        tracker.agreement.check(is_last=True)
        remarks += tracker.agreement.remarks(recording.names[1:])
    if files.body is not None:
        save_body_model(tracker.body, files.body)
    return TrackSummary(frames, len(costs), *mean, frames_uncertain, tuple(remarks), tracker.body)
