"""A recorded session with ground truth as arrays, one row for each image.

A session is a folder with ``bag/`` and ``ground_truth.json``. It may also have
``peer_mediapipe.json`` with MediaPipe Pose's figures on the same images, and ``extrinsics.yaml``
with the poses of several cameras.

Sessions of real people have no reference postures: the person was not measured, but stature and
distance are known.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.errors import CardboxError, cut
from cardbox_tracker.common.files import UnreadableFileError, read_regular
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth

FloatArray = NDArray[np.float64]

MARGIN_S = 0.2
"""Margin at both ends of a segment, because people move earlier or later than it says."""

PROTOCOL = ("empty", "enter", "front", "side", "arms", "transition")
"""Segments before the motions; they are not scored unless postures are asked for."""
_MOST_BYTES = 16 * 1024 * 1024

REFERENCES = ("front", "side", "arms")
"""Segments in which the person is measured."""

REFERENCE_SPANS = ("empty", *REFERENCES)


@dataclass(frozen=True)
class RecordedSession:
    """One recording of N images with a person in some of them.

    Attributes:
        name: of its folder.
        bag: its recording.
        extrinsics: file with the poses of its cameras; None without it.
        truth: its ground truth; its cameras are those that track.
        spans: ``empty`` and the three reference postures, as far as the session has them, without
            their margins.
        start_s: start of the motions, seconds from the bag's start.
        stamps_ns: stamps of the scored images, (n,), int64.
        segments: name of the segment of each image, (n,).
        keypoints_m: true keypoints, (n, 6, 3), metres in the optical frame.
        torso_rad: true roll, pitch, yaw of the torso, (n, 3); nan where unknown.
        mediapipe: MediaPipe's figures over the motions, cm by name; empty without its file.
        mediapipe_ms: MediaPipe's time for an image, ms; None where it was not measured.
        hips_m: true middle of the hips, (n, 3), metres in the optical frame; nan where unknown.
            None if no image has it.
        is_rectified: whether the first two cameras that track are a rectified pair.
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
    hips_m: FloatArray | None = None
    is_rectified: bool = False

    @property
    def to_optical(self) -> FloatArray:
        """Rotation (3, 3) from the level reference frame into the camera's optical frame."""
        return level_to_optical(np.radians(self.truth.pitch_deg))

    @property
    def has_references(self) -> bool:
        """Whether the session has the reference postures, so that the person is measured."""
        return all(name in self.spans for name in REFERENCES)


def load_session(
    folder: str | os.PathLike[str], cameras: Sequence[str] = (), postures: bool = False
) -> RecordedSession:
    """Read the ground truth of a session.

    Args:
        folder: the session.
        cameras: namespaces of those of its cameras that track; the true positions are in the frame
            of the first one. All cameras of the session, if this is empty.
        postures: track from the front reference posture on, and score it and what follows, too: a
            body that was measured there knows these images.

    Raises:
        CardboxError: the folder is not a session; the text names the missing part.
    """
    path = Path(folder)
    file = path / "ground_truth.json"
    truth = load_ground_truth(file)
    pair = truth.cameras[:2] if "baseline_m" in file.read_text(encoding="utf-8") else None
    if cameras:
        truth = _with_cameras(path, truth, cameras)
    _check_segments(path, truth)
    unscored = PROTOCOL[: PROTOCOL.index(REFERENCES[0])] if postures else PROTOCOL
    scored = {
        stamp: frame
        for stamp, frame in sorted(truth.frames.items())
        if frame.is_in_sight and frame.segment not in unscored
    }
    unknown, extrinsics = np.full(3, np.nan), path / "extrinsics.yaml"
    hips = [unknown if frame.hips_m is None else frame.hips_m for frame in scored.values()]
    return RecordedSession(
        path.name,
        path / "bag",
        extrinsics if extrinsics.is_file() else None,
        truth,
        {name: _inside(*truth.spans[name]) for name in REFERENCE_SPANS if name in truth.spans},
        truth.spans[REFERENCES[0] if postures else _first_motion(truth)][0],
        np.array(list(scored), np.int64),
        np.array([frame.segment for frame in scored.values()]),
        np.array([frame.keypoints_m for frame in scored.values()]).reshape(-1, 6, 3),
        np.array(
            [f.torso_rad if f.torso_rad is not None else unknown for f in scored.values()]
        ).reshape(-1, 3),
        *_mediapipe(path / "peer_mediapipe.json", truth.cameras),
        np.array(hips) if np.isfinite(hips).any() else None,
        truth.cameras[:2] == pair,
    )


def _with_cameras(path: Path, truth: GroundTruth, cameras: Sequence[str]) -> GroundTruth:
    unknown = [name for name in cameras if name not in truth.cameras]
    if unknown:
        raise CardboxError(
            f"{path} has no camera {', '.join(unknown)}; expected some of "
            f"{', '.join(truth.cameras) or 'none: it has a single camera without a name'}"
        )
    seen = load_ground_truth(path / "ground_truth.json", cameras[0])
    return replace(seen, cameras=tuple(cameras))


def _check_segments(path: Path, truth: GroundTruth) -> None:
    """Refuse a session that can neither be measured nor be tracked without measuring."""
    needed = (*REFERENCE_SPANS, "neutral")
    missing = [name for name in needed if name not in truth.spans]
    if not any(name in truth.spans for name in REFERENCES):
        if truth.stature_m is None:
            raise CardboxError(
                f"{path} has no segment {', '.join(missing)} and no stature; a session has either "
                "an empty scene, the three reference postures, 'neutral', and motions, or the "
                "'height' of the person"
            )
        if _first_motion(truth) in PROTOCOL:
            raise CardboxError(
                f"{path} has no segment with motions; it has {', '.join(truth.spans)}"
            )
    elif missing:
        raise CardboxError(
            f"{path} has no segment {', '.join(missing)}; a session has an empty scene, the three "
            "reference postures, 'neutral', and motions"
        )


def _first_motion(truth: GroundTruth) -> str:
    """Return the segment with which tracking starts."""
    if "neutral" in truth.spans:
        return "neutral"
    motions = [name for name in truth.spans if name not in PROTOCOL]
    return (motions or list(truth.spans))[0]


def _inside(start_s: float, end_s: float) -> TimeSpan:
    margin_s = min(MARGIN_S, (end_s - start_s) / 4)
    return TimeSpan(start_s + margin_s, end_s - margin_s)


def _mediapipe(path: Path, cameras: Sequence[str]) -> tuple[dict[str, float], float | None]:
    """Return MediaPipe's figures and time; those of each camera alone are the first camera's."""
    if not path.is_file():
        return {}, None
    try:
        data = json.loads(read_regular(path, _MOST_BYTES))
        if "mean" not in data and "aligned" in data:
            return _of_camera(data["aligned"], cameras), None
        motions = data["mean"]["motions"].items()
        return {n: float(v) for n, v in motions if _is_number(v)}, float(data["ms_median"])
    except (UnreadableFileError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise CardboxError(
            f"{path} is not a file of MediaPipe's figures: {cut(repr(error))}; remove it, or make "
            "it again"
        ) from None


def _of_camera(aligned: Mapping[str, Any], cameras: Sequence[str]) -> dict[str, float]:
    value = aligned.get(cameras[0]) if cameras else None
    return {} if value is None else {"aligned": float(value)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
