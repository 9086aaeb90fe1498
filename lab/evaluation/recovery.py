"""Recovery of the tracker after disturbances.

A recording is tracked once without disturbance and once for each kind of disturbance, which is
repeated every few seconds:

- ``absent``: nobody is in the silhouette for a second;
- ``gap``: no image comes for half a second;
- ``arm hidden``: one forearm, in turns the left and the right, is missing for a second.

A trial counts as recovered if the mean error of the images half a second to one second after the
disturbance is at most 4 cm above that of the undisturbed run, or below 10 cm.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.session import RecordedSession

FloatArray = NDArray[np.float64]
Silhouette = NDArray[np.uint8]

KINDS: dict[str, float] = {"absent": 1.0, "gap": 0.5, "arm hidden": 1.0}
"""Disturbances and how long each lasts, seconds."""

PERIOD_S = 5.0
"""Period of the disturbances."""

_FIRST_S = 2.0
_JUDGED_S = (0.5, 1.0)
_MORE_CM, _GOOD_CM = 4.0, 10.0
_FOREARM_RADIUS_M = 0.09


@dataclass(frozen=True)
class Recovery:
    """Number of trials of one kind, and of those that recovered."""

    recovered: int
    trials: int


def measure_recovery(
    session: RecordedSession,
    frames: list[RecordedFrame],
    body: BodyModel,
    camera: Camera,
    config: TrackerConfig,
    seed: int,
) -> dict[str, Recovery]:
    """Return the recoveries on one session, by kind of disturbance.

    Args:
        session: session with the ground truth.
        frames: all frames from the first neutral posture on.
        body: the measured person.
        camera: camera at the working resolution.
        config: settings of the tracker.
        seed: random seed of all runs.
    """
    truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    pitched = camera.with_pitch(body.camera_pose.pitch_rad)

    def errors_cm(kind: str | None) -> dict[int, float]:
        tracker = Tracker(body, camera, config, np.random.default_rng(seed))
        found = {}
        for frame, silhouette in _disturbed(frames, kind, truth, pitched):
            estimate = tracker.track(silhouette, frame.image, frame.stamp_ns)
            if estimate.keypoints_m is not None and frame.stamp_ns in truth:
                off_m = np.linalg.norm(estimate.keypoints_m - truth[frame.stamp_ns], axis=1)
                found[frame.stamp_ns] = 100 * float(off_m.mean())
        return found

    undisturbed = errors_cm(None)
    result = {}
    for kind, lasts_s in KINDS.items():
        disturbed = errors_cm(kind)
        outcomes = []
        for begin_s in _beginnings(frames):
            end_s = begin_s + lasts_s
            judged = [
                f.stamp_ns
                for f in frames
                if end_s + _JUDGED_S[0] <= f.time_s <= end_s + _JUDGED_S[1]
                and f.stamp_ns in undisturbed
            ]
            if judged:
                before = float(np.mean([undisturbed[stamp] for stamp in judged]))
                after = np.mean([disturbed.get(stamp, np.inf) for stamp in judged])
                outcomes.append(bool(after <= max(before + _MORE_CM, _GOOD_CM)))
        result[kind] = Recovery(sum(outcomes), len(outcomes))
    return result


def _beginnings(frames: list[RecordedFrame]) -> list[float]:
    first, last = frames[0].time_s + _FIRST_S, frames[-1].time_s - PERIOD_S / 2
    return np.arange(first, max(last, first), PERIOD_S).tolist()


def _disturbed(
    frames: list[RecordedFrame], kind: str | None, truth: dict[int, FloatArray], camera: Camera
) -> Iterator[tuple[RecordedFrame, Silhouette]]:
    """Yield the frames of the disturbed recording, each with its silhouette."""
    beginnings = _beginnings(frames) if kind is not None else []
    for frame in frames:
        trial = next(
            (
                i
                for i, begin_s in enumerate(beginnings)
                if kind is not None and begin_s <= frame.time_s < begin_s + KINDS[kind]
            ),
            None,
        )
        if trial is None:
            yield frame, frame.silhouette
        elif kind == "absent":
            yield frame, np.zeros_like(frame.silhouette)
        elif kind == "arm hidden":
            yield frame, _without_forearm(frame, truth, camera, trial % 2)


def _without_forearm(
    frame: RecordedFrame, truth: dict[int, FloatArray], camera: Camera, arm: int
) -> Silhouette:
    """Return the silhouette without the left (0) or right (1) forearm and hand."""
    if frame.stamp_ns not in truth:
        return frame.silhouette
    points = truth[frame.stamp_ns][3 * arm + 1 : 3 * arm + 3]
    # The fingers reach beyond the keypoint of the hand.
    ends = np.stack([points[0], points[1] + 0.3 * (points[1] - points[0])])
    (elbow, tip) = np.round(camera.project(ends)).astype(int).tolist()
    width = max(1, round(2 * _FOREARM_RADIUS_M * camera.fx / float(points[:, 2].mean())))
    seen = frame.silhouette.copy()
    cv2.line(seen, elbow, tip, 0, width)
    return seen
