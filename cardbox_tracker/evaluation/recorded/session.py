"""A recorded session with ground truth as arrays, one row for each image.

A session is a folder with ``bag/`` and ``ground_truth.json``. It may also have
``peer_mediapipe.json`` with MediaPipe Pose's figures on the same images, and ``extrinsics.yaml``
with the poses of several cameras.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.evaluation.truth import GroundTruth, load_ground_truth
from cardbox_tracker.recordings.silhouettes import TimeSpan

FloatArray = NDArray[np.float64]

MARGIN_S = 0.2
"""Margin at both ends of a segment, because people move earlier or later than it says."""

PROTOCOL = ("empty", "enter", "front", "side", "arms", "transition")
"""Segments before the motions; they are not scored."""

REFERENCE_SPANS = ("empty", "front", "side", "arms")


@dataclass(frozen=True)
class RecordedSession:
    """One recording of N images with a person in some of them.

    Attributes:
        name: of its folder.
        bag: its recording.
        extrinsics: file with the poses of its cameras; None without it.
        truth: its ground truth.
        spans: ``empty`` and the three reference postures, without their margins.
        start_s: start of the motions, seconds from the bag's start.
        stamps_ns: stamps of the scored images, (n,), int64.
        segments: name of the segment of each image, (n,).
        keypoints_m: true keypoints, (n, 6, 3), metres in the optical frame.
        torso_rad: true roll, pitch, yaw of the torso, (n, 3); nan where unknown.
        mediapipe: MediaPipe's figures over the motions, cm by name; empty without its file.
        mediapipe_ms: MediaPipe's time for an image, ms; None without its file.
    """

    name: str
    bag: Path
    extrinsics: Path | None
    truth: GroundTruth
    spans: dict[str, TimeSpan]
    start_s: float
    stamps_ns: NDArray[np.int64]
    segments: NDArray[np.str_]
    keypoints_m: FloatArray
    torso_rad: FloatArray
    mediapipe: dict[str, float]
    mediapipe_ms: float | None


def load_session(folder: str | os.PathLike[str]) -> RecordedSession:
    """Read the ground truth of a session.

    Raises:
        CardboxError: the folder is not a session; the text names the missing part.
    """
    path = Path(folder)
    truth = load_ground_truth(path / "ground_truth.json")
    missing = [name for name in (*REFERENCE_SPANS, "neutral") if name not in truth.spans]
    if missing:
        raise CardboxError(
            f"{path} has no segment {', '.join(missing)}; a session has an empty scene, the three "
            "reference postures, 'neutral', and motions"
        )
    scored = {
        stamp: frame
        for stamp, frame in sorted(truth.frames.items())
        if frame.is_in_sight and frame.segment not in PROTOCOL
    }
    unknown, extrinsics = np.full(3, np.nan), path / "extrinsics.yaml"
    return RecordedSession(
        path.name,
        path / "bag",
        extrinsics if extrinsics.is_file() else None,
        truth,
        {name: _inside(*truth.spans[name]) for name in REFERENCE_SPANS},
        truth.spans["neutral"][0],
        np.array(list(scored), np.int64),
        np.array([frame.segment for frame in scored.values()]),
        np.array([frame.keypoints_m for frame in scored.values()]).reshape(-1, 6, 3),
        np.array(
            [f.torso_rad if f.torso_rad is not None else unknown for f in scored.values()]
        ).reshape(-1, 3),
        *_mediapipe(path / "peer_mediapipe.json"),
    )


def _inside(start_s: float, end_s: float) -> TimeSpan:
    margin_s = min(MARGIN_S, (end_s - start_s) / 4)
    return TimeSpan(start_s + margin_s, end_s - margin_s)


def _mediapipe(path: Path) -> tuple[dict[str, float], float | None]:
    if not path.is_file():
        return {}, None
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        motions = data["mean"]["motions"].items()
        return {n: float(v) for n, v in motions if _is_number(v)}, float(data["ms_median"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise CardboxError(
            f"{path} is not a file of MediaPipe's figures: {error!r}; remove it, or make it again"
        ) from None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
