"""Sessions with and without reference postures, and those of their cameras that track."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from lab.evaluation.session import load_session

MARKS = ("hips", *KEYPOINT_NAMES)


def seen_at(x_m: float, z_m: float, v: float = 100.0) -> dict[str, Any]:
    return {
        "joints_m": {name: [x_m, 0.0, z_m] for name in MARKS},
        "joints_px": {"neck": [100.0, v]},
    }


def two_cameras() -> dict[str, Any]:
    frames = [
        {"stamp_ns": n, "segment": "dance", **seen_at(0.1, 2.0)}
        | {"cameras": {"a": {"stamp_ns": n, **seen_at(0.1, 2.0)}}}
        for n in (1000, 2000, 3000)
    ]
    for frame, v in zip(frames, (100.0, 100.0, 999.0), strict=True):
        frame["cameras"]["b"] = {"stamp_ns": frame["stamp_ns"] + 8, **seen_at(0.3, 3.0, v)}
    frames.append({"stamp_ns": 4000, "segment": "dance", "cameras": {"b": {"stamp_ns": 4008}}})
    size = {"width": 320, "height": 240}
    return {
        "camera": {"pitch_down_deg": 4, **size},
        "cameras": [
            {"name": "a", "pitch_down_deg": 4, **size},
            {"name": "b", "pitch_down_deg": 60, **size},
        ],
        "person": {"distance_m": 1.9, "height": 1.7},
        "side_posture_turns_to": "left",
        "segments": [{"name": "dance", "start_s": 0.5, "end_s": 1.0}],
        "frames": frames,
    }


def write(folder: Path, data: dict[str, Any]) -> Path:
    (folder / "ground_truth.json").write_text(json.dumps(data))
    return folder


def test_a_session_without_references_starts_with_its_first_motion(tmp_path: Path) -> None:
    session = load_session(write(tmp_path, two_cameras()))
    assert not session.has_references
    assert (session.start_s, session.spans) == (0.5, {})
    assert session.stamps_ns.tolist() == [1000, 2000, 3000]
    assert session.hips_m is not None
    np.testing.assert_allclose(session.hips_m[0], (0.1, 0.0, 2.0))


def test_an_empty_scene_is_kept_and_not_a_motion(tmp_path: Path) -> None:
    data = two_cameras()
    data["segments"].insert(0, {"name": "empty", "start_s": 0.0, "end_s": 0.4})
    session = load_session(write(tmp_path, data))
    assert session.start_s == 0.5
    assert list(session.spans) == ["empty"]


def test_cameras_are_chosen_and_the_truth_is_the_first_ones(tmp_path: Path) -> None:
    session = load_session(write(tmp_path, two_cameras()), ("b",))
    truth = session.truth
    assert (truth.cameras, truth.pitch_deg, truth.start_ns) == (("b",), 60.0, 1008)
    # In the third image the person is not in this camera's view.
    assert session.stamps_ns.tolist() == [1008, 2008]
    np.testing.assert_allclose(session.keypoints_m[0, 0], (0.3, 0.0, 3.0))
    assert truth.distance_m == pytest.approx(3.0 * np.cos(np.radians(60.0)))
    both = load_session(tmp_path, ("a", "b")).truth
    assert (both.cameras, both.distance_m) == (("a", "b"), 1.9)
    with pytest.raises(CardboxError, match="no camera c; expected some of a, b"):
        load_session(tmp_path, ("a", "c"))


def test_the_error_of_mediapipe_is_that_of_the_first_camera(tmp_path: Path) -> None:
    write(tmp_path, two_cameras())
    (tmp_path / "peer_mediapipe.json").write_text(json.dumps({"aligned": {"b": 9.5}}))
    assert load_session(tmp_path, ("b", "a")).mediapipe == {"aligned": 9.5}
    assert load_session(tmp_path).mediapipe == {}


def test_somebody_of_unknown_stature_must_be_measured(tmp_path: Path) -> None:
    data = two_cameras()
    del data["person"]["height"]
    with pytest.raises(CardboxError, match=r"front, side, arms.* and no stature"):
        load_session(write(tmp_path, data))


def test_some_of_the_references_are_not_enough(tmp_path: Path) -> None:
    data = two_cameras()
    data["segments"].append({"name": "arms", "start_s": 1.0, "end_s": 2.0})
    with pytest.raises(CardboxError, match="no segment empty, front, side, neutral;"):
        load_session(write(tmp_path, data))


def test_a_session_needs_motions(tmp_path: Path) -> None:
    data = two_cameras()
    data["segments"] = [{"name": "empty", "start_s": 0.0, "end_s": 1.0}]
    with pytest.raises(CardboxError, match="no segment with motions; it has empty"):
        load_session(write(tmp_path, data))
