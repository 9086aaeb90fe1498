"""``cardbox track``: track the posture in every image of a recording."""

from __future__ import annotations

import csv
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.kinematics import KEYPOINT_NAMES
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.neck import NECK_NAMES
from cardbox_tracker.body.posture import PLACE, POSTURE
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.estimate import UNCERTAIN, Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.files import atomic_path, stamp_text
from cardbox_tracker.outputs import JOINT_STATE_NAMES, METRICS, joint_values
from cardbox_tracker.recordings.overlay_video import overlay_video
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame

# New columns are appended, because scripts read these by their position.
CSV_HEADER = (
    "stamp",
    "state",
    *JOINT_STATE_NAMES[POSTURE],
    *(f"{name}_{axis}" for name in KEYPOINT_NAMES for axis in "xyz"),
    *(metric.name for metric in METRICS),
    *JOINT_STATE_NAMES[PLACE],
)

NECK_COLUMNS = NECK_NAMES
"""Columns that follow ``CSV_HEADER`` if the recording has points of the person."""

Observer = Callable[[RecordedFrame, Estimate, Tracker], None]
"""Callback that receives each image with its estimate and the tracker."""


class TrackFiles(NamedTuple):
    """Files to write; None for one that is not wanted.

    Attributes:
        csv: table with one row for each image.
        video: overlay video, at the rate and the resolution of the recording.
    """

    csv: Path | None = None
    video: Path | None = None


_NO_FILES = TrackFiles()


@dataclass(frozen=True)
class TrackSummary:
    """Summary of a run.

    Attributes:
        frames: number of images.
        frames_tracked: number of images with a posture.
        mean_cost_px: mean cost over the tracked images; nan without any.
        mean_iou: mean overlap (IoU) over the tracked images; nan without any.
        frames_uncertain: number of tracked images whose posture may be wrong.
        remarks: warnings about extrinsics that seem to be wrong.
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
    files: TrackFiles = _NO_FILES,
    observers: tuple[Observer, ...] = (),
) -> TrackSummary:
    """Track every image from ``start_s`` on.

    Args:
        recording: an open recording.
        body: the measured person.
        config: settings of the tracker.
        seed: random seed; the same recording and seed give the same bytes.
        start_s: seconds from the recording's start at which the person stands in the front
            reference posture.
        files: files to write; the table is written atomically.
        observers: called after each image, such as a progress bar or a bag writer.

    Raises:
        CardboxError: no image lies after ``start_s``, or a file cannot be written.
    """
    rng = np.random.default_rng(seed)
    tracker = Tracker(body, recording.first.camera, config, rng, others=recording.others)
    costs: list[int] = []
    ious: list[float] = []
    frames = frames_uncertain = 0
    with ExitStack() as stack:
        rows, has_points = None, recording.first.has_points
        if files.csv is not None:
            path = stack.enter_context(atomic_path(files.csv))
            table = stack.enter_context(path.open("w", newline="", encoding="utf-8"))
            rows = csv.writer(table, lineterminator="\n")
            rows.writerow((*CSV_HEADER, *NECK_COLUMNS) if has_points else CSV_HEADER)
        if files.video is not None:
            video = stack.enter_context(overlay_video(files.video, recording))
            observers = (video, *observers)
        for taken in recording.frames(start_s):
            estimate, frame = tracker.track(taken.observations), taken.first
            frames += 1
            frames_uncertain += estimate.state == UNCERTAIN
            if rows is not None:
                neck = _neck_fields(estimate) if has_points else []
                rows.writerow([*csv_row(frame.stamp_ns, estimate), *neck])
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
    remarks: list[str] = []
    if tracker.agreement is not None:
        tracker.agreement.check(is_last=True)
        remarks = tracker.agreement.remarks(recording.names[1:])
    return TrackSummary(frames, len(costs), *mean, frames_uncertain, tuple(remarks), tracker.body)


def _neck_fields(estimate: Estimate) -> list[str]:
    if estimate.neck is None:
        return [""] * len(NECK_COLUMNS)
    return [f"{value:.6f}" for value in estimate.neck]


def csv_row(stamp_ns: int, estimate: Estimate) -> list[str]:
    """Return the row of one image; unknown values are empty."""
    stamp = stamp_text(stamp_ns)
    joints = joint_values(estimate)
    if joints is None or estimate.keypoints_m is None:
        return [stamp, estimate.state, *[""] * (len(CSV_HEADER) - 2)]
    values = [f"{value:.6f}" for value in joints.values]
    return [
        stamp,
        estimate.state,
        *values[POSTURE],
        *(f"{value:.6f}" for value in estimate.keypoints_m.ravel()),
        *(metric.text(estimate) for metric in METRICS),
        *values[PLACE],
    ]
