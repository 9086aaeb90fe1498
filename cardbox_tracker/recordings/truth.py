"""Ground truth of a recorded session, and the error of estimates."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES, SHOULDERS

# A person who is about to move still stands where the recording began in this many frames.
_FIRST_FRAMES = 10


@dataclass(frozen=True)
class TrueFrame:
    """One image with a person."""

    segment: str  #: name of the person's action
    #: shape (6, 3), metres in the optical frame, ordered as ``KEYPOINT_NAMES``.
    keypoints_m: FloatArray
    #: d1..d12 (12,); None if the person does not have the model's joints.
    posture: FloatArray | None
    torso_rad: FloatArray | None  #: roll, pitch and yaw of the torso (3,); None if unknown
    is_in_sight: bool = True  #: True if the neck is in the image, so that the person can be tracked
    #: middle of the hips (3,), metres in the optical frame; None if unknown.
    hips_m: FloatArray | None = None


@dataclass(frozen=True)
class GroundTruth:
    """Ground truth of a session."""

    frames: Mapping[int, TrueFrame]  #: images with a person, by stamp in nanoseconds
    #: start and end of the first segment of each name, seconds from the first image.
    spans: Mapping[str, tuple[float, float]]
    start_ns: int  #: stamp of the first image
    distance_m: float  #: horizontal distance to the person
    pitch_deg: float  #: downward pitch of the camera
    side_turn: str  #: direction in which the person turned for the side reference
    #: namespaces of several cameras, the first camera's first; empty with one.
    cameras: tuple[str, ...] = ()
    stature_m: float | None = None  #: height of the person; None if unknown
    #: topic of depth images with the first camera's field of view; None without.
    depth_topic: str | None = None
    source: str = ""  #: origin and licence of the recording; empty if the file does not say


def load_ground_truth(path: str | os.PathLike[str], camera: str | None = None) -> GroundTruth:
    """Read the ``ground_truth.json`` of a session, for the first camera or for ``camera``.

    The distance to any other camera than the first is that of the true hips, or else shoulders, in
    its first images. Raises CardboxError if the file cannot be read or is none.
    """
    expected = "the ground_truth.json of a session, such as 'cardbox synthesize' writes"
    with foreign(path, CardboxError, expected):
        data = json.loads(read_regular(path))
        if camera is not None:
            data = _seen_by(data, camera)
        frames = {}
        for entry in data["frames"]:
            if "joints_m" not in entry:
                continue
            joints = entry["joints_m"]
            points = np.array([joints[name] for name in KEYPOINT_NAMES], np.float64)
            posture = torso = None
            if "posture" in entry:
                posture = np.array([entry["posture"][name] for name in JOINT_NAMES], np.float64)
            if "torso_rpy_deg" in entry:
                torso = np.radians(entry["torso_rpy_deg"])
            frames[int(entry["stamp_ns"])] = TrueFrame(
                entry["segment"],
                points,
                posture,
                torso,
                _is_in_sight(entry, data["camera"]),
                np.array(joints["hips"]) if "hips" in joints else None,
            )
        spans: dict[str, tuple[float, float]] = {}
        for segment in data["segments"]:
            spans.setdefault(segment["name"], (segment["start_s"], segment["end_s"]))
        stature_m = data["person"].get("height")
        return GroundTruth(
            frames,
            spans,
            int(data["frames"][0]["stamp_ns"]),
            _distance_m(data, frames),
            float(data["camera"]["pitch_down_deg"]),
            str(data["side_posture_turns_to"]),
            tuple(str(camera["name"]) for camera in data.get("cameras", ())),
            None if stature_m is None else float(stature_m),
            data.get("depth_topic"),
            str(data.get("source", "")),
        )


def _seen_by(data: dict[str, Any], camera: str) -> dict[str, Any]:
    """Return the ground truth with the values of one camera in place of the first one's."""
    own = {str(one["name"]): one for one in data["cameras"]}
    if camera == str(data["cameras"][0]["name"]):
        return data
    shared = ("segment", "torso_rpy_deg", "posture")
    frames = [
        {key: entry[key] for key in shared if key in entry} | entry["cameras"][camera]
        for entry in data["frames"]
    ]
    person = {key: value for key, value in data["person"].items() if key != "distance_m"}
    return data | {"camera": own[camera], "person": person, "frames": frames}


def _distance_m(data: Mapping[str, Any], frames: Mapping[int, TrueFrame]) -> float:
    """Return the horizontal distance to the person, as it is given or from the first frames."""
    if "distance_m" in data["person"]:
        return float(data["person"]["distance_m"])
    first = list(frames.values())[:_FIRST_FRAMES]
    middles = [
        f.keypoints_m[SHOULDERS, :].mean(axis=0) if f.hips_m is None else f.hips_m for f in first
    ]
    to_optical = level_to_optical(np.radians(float(data["camera"]["pitch_down_deg"])))
    return float(-np.median((np.array(middles) @ to_optical)[:, 0]))


def _is_in_sight(entry: Mapping[str, Any], camera: Mapping[str, Any]) -> bool:
    if "joints_px" not in entry:
        return True
    u, v = entry["joints_px"]["neck"]
    return bool(0 <= u < camera["width"] and 0 <= v < camera["height"])


def tracking_error(estimates: Mapping[int, FloatArray], truth: GroundTruth) -> dict[str, Any]:
    """Return the mean distances of keypoints (6, 3), metres, optical frame, from the truth.

    They are those of all, of each keypoint, in each segment of the session, and along x, y and z.
    Raises CardboxError if no stamp fits.
    """
    stamps = [stamp for stamp in estimates if stamp in truth.frames]
    if not stamps:
        raise CardboxError(
            "no estimate has the stamp of a true frame; give the ground truth of this recording"
        )
    differences = np.array([estimates[s] - truth.frames[s].keypoints_m for s in stamps])
    distances = np.linalg.norm(differences, axis=2)
    segments: dict[str, list[float]] = defaultdict(list)
    for stamp, row in zip(stamps, distances, strict=True):
        segments[truth.frames[stamp].segment].append(float(row.mean()))
    by_keypoint = zip(KEYPOINT_NAMES, distances.mean(axis=0).tolist(), strict=True)
    names = "lateral_error_m", "vertical_error_m", "depth_error_m"
    return {
        "mean_3d_error_m": float(distances.mean()),
        "error_by_keypoint_m": dict(by_keypoint),
        "error_by_segment_m": {name: float(np.mean(one)) for name, one in segments.items()},
        **dict(zip(names, np.abs(differences).mean(axis=(0, 1)).tolist(), strict=True)),
    }


def beside_shoulders(difference: FloatArray) -> FloatArray:
    """Return differences of keypoints (..., 6, 3) without that of the middle of the shoulders."""
    local: FloatArray = difference - difference[..., SHOULDERS, :].mean(axis=-2, keepdims=True)
    return local
