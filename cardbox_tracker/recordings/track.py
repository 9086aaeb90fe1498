"""``cardbox track``: follow the posture through a recording; no image is dropped."""

from __future__ import annotations

import csv
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cardbox_tracker.body.kinematics import KEYPOINT_NAMES
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import PLACE, POSTURE
from cardbox_tracker.drawing.overlay import draw_overlay
from cardbox_tracker.drawing.video import video_file
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.estimate import UNCERTAIN, Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.files import atomic_path, stamp_text
from cardbox_tracker.outputs import JOINT_STATE_NAMES, METRICS, joint_values
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame

# Scripts read the columns by their place: further joints follow the last of them.
CSV_HEADER = (
    "stamp",
    "state",
    *JOINT_STATE_NAMES[POSTURE],
    *(f"{name}_{axis}" for name in KEYPOINT_NAMES for axis in "xyz"),
    *(metric.name for metric in METRICS),
    *JOINT_STATE_NAMES[PLACE],
)

Observer = Callable[[RecordedFrame, Estimate, Tracker], None]
"""Is told of each image and what was found in it."""

_VIDEO_SCALE = 2


@dataclass(frozen=True)
class TrackSummary:
    """What a run did: images seen and tracked, and means over the tracked ones.

    ``frames_uncertain`` of the tracked ones have a posture that may be wrong; ``remarks`` are about
    extrinsics that seem to be wrong.
    """

    frames: int
    frames_tracked: int
    mean_cost_px: float
    mean_iou: float
    frames_uncertain: int = 0
    remarks: tuple[str, ...] = ()


def track_recording(
    recording: Recording,
    body: BodyModel,
    config: TrackerConfig,
    seed: int,
    start_s: float,
    csv_path: Path | None,
    video_path: Path | None = None,
    fps: float = 15.0,
    observers: tuple[Observer, ...] = (),
) -> TrackSummary:
    """Track every image from ``start_s`` on; write one CSV row for each.

    Args:
        recording: with its cameras.
        body: the measured person.
        config: settings of the tracker.
        seed: the same recording and seed give the same bytes.
        start_s: when the person stands in the front reference posture, from the bag's start.
        csv_path: written atomically, if at all.
        video_path: where to write the overlay, if at all.
        fps: frames a second of the video.
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
        rows = None
        if csv_path is not None:
            table = stack.enter_context(
                stack.enter_context(atomic_path(csv_path)).open("w", newline="", encoding="utf-8")
            )
            rows = csv.writer(table, lineterminator="\n")
            rows.writerow(CSV_HEADER)
        draw = None
        if video_path is not None:
            size = (_VIDEO_SCALE * tracker.camera.width, _VIDEO_SCALE * tracker.camera.height)
            draw = stack.enter_context(video_file(video_path, size, fps))
        for taken in recording.frames(start_s):
            estimate, frame = tracker.track(taken.observations), taken.first
            frames += 1
            frames_uncertain += estimate.state == UNCERTAIN
            if rows is not None:
                rows.writerow(csv_row(frame.stamp_ns, estimate))
            if estimate.cost_px is not None and estimate.iou is not None:
                costs.append(estimate.cost_px)
                ious.append(estimate.iou)
            if draw is not None:
                draw(
                    draw_overlay(
                        frame.picture, tracker.body, tracker.camera, estimate, _VIDEO_SCALE
                    )
                )
            for observe in observers:
                observe(frame, estimate, tracker)
            if tracker.agreement is not None and tracker.agreement.is_due:
                tracker.agreement.check()
        if frames == 0:
            raise CardboxError(
                f"no image lies after --start {start_s:g} s; give seconds from the bag's start"
            )
    mean = (float(np.mean(costs)), float(np.mean(ious))) if costs else (float("nan"),) * 2
    remarks: list[str] = []
    if tracker.agreement is not None:
        tracker.agreement.check(is_last=True)
        remarks = tracker.agreement.remarks(recording.names[1:])
    return TrackSummary(frames, len(costs), *mean, frames_uncertain, tuple(remarks))


def csv_row(stamp_ns: int, estimate: Estimate) -> list[str]:
    """Return the row of one image; what is not known is left empty."""
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
