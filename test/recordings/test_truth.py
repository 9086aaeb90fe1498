"""Ground truth: what is read, what is refused, and the error against it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.recordings.truth import load_ground_truth, tracking_error


def frame(stamp_ns: int, segment: str, x_m: float) -> dict[str, Any]:
    return {
        "stamp_ns": stamp_ns,
        "segment": segment,
        "joints_m": {name: [x_m, i / 10, 2.0] for i, name in enumerate(KEYPOINT_NAMES)},
    }


def truth_data() -> dict[str, Any]:
    return {
        "camera": {"pitch_down_deg": 4},
        "person": {"distance_m": 1.8},
        "side_posture_turns_to": "right",
        "segments": [
            {"name": "empty", "start_s": 0.0, "end_s": 1.0},
            {"name": "neutral", "start_s": 1.0, "end_s": 2.0},
            {"name": "wave", "start_s": 2.0, "end_s": 3.0},
            {"name": "neutral", "start_s": 3.0, "end_s": 4.0},
        ],
        "frames": [
            {"stamp_ns": 1000, "segment": "empty"},
            frame(2000, "wave", 0.0),
            frame(3000, "wave", 0.1),
            frame(4000, "neutral", 0.2),
        ],
    }


def write(folder: Path, data: Any) -> Path:
    path = folder / "ground_truth.json"
    path.write_text(json.dumps(data))
    return path


def test_reading(tmp_path: Path) -> None:
    truth = load_ground_truth(write(tmp_path, truth_data()))
    assert list(truth.frames) == [2000, 3000, 4000]
    assert truth.start_ns == 1000
    assert (truth.distance_m, truth.pitch_deg, truth.side_turn) == (1.8, 4.0, "right")
    assert truth.spans["neutral"] == (1.0, 2.0)
    seen = truth.frames[3000]
    assert seen.segment == "wave"
    np.testing.assert_allclose(seen.keypoints_m[2], [0.1, 0.2, 2.0])
    assert seen.posture is None
    assert seen.torso_rad is None
    assert truth.stature_m is None


def test_the_stature_is_read_where_it_is_known(tmp_path: Path) -> None:
    data = truth_data()
    data["person"]["height"] = 1.64
    assert load_ground_truth(write(tmp_path, data)).stature_m == 1.64


def test_joints_are_ordered_by_name_and_angles_read(tmp_path: Path) -> None:
    data = truth_data()
    entry = data["frames"][1]
    entry["joints_m"] = dict(reversed(entry["joints_m"].items()))
    entry["posture"] = {name: float(i) for i, name in reversed(list(enumerate(JOINT_NAMES)))}
    entry["torso_rpy_deg"] = [180.0, 0.0, -90.0]
    seen = load_ground_truth(write(tmp_path, data)).frames[2000]
    np.testing.assert_allclose(seen.keypoints_m[:, 1], np.arange(6) / 10)
    assert seen.posture is not None
    assert seen.torso_rad is not None
    np.testing.assert_allclose(seen.posture, np.arange(12))
    np.testing.assert_allclose(seen.torso_rad, [np.pi, 0.0, -np.pi / 2])


@pytest.mark.parametrize("missing", ["camera", "person", "frames", "segments"])
def test_a_missing_part_is_named(tmp_path: Path, missing: str) -> None:
    data = truth_data()
    del data[missing]
    with pytest.raises(CardboxError, match=rf"ground.truth.*{missing}"):
        load_ground_truth(write(tmp_path, data))


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '{"frames": []}'])
def test_what_is_no_ground_truth_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "ground_truth.json"
    path.write_text(text)
    with pytest.raises(CardboxError, match=r"ground_truth\.json"):
        load_ground_truth(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"nothing\.json"):
        load_ground_truth(tmp_path / "nothing.json")


def test_error_by_hand(tmp_path: Path) -> None:
    truth = load_ground_truth(write(tmp_path, truth_data()))
    estimates = {
        2000: truth.frames[2000].keypoints_m + np.array([0.03, 0.0, 0.04]),
        4000: truth.frames[4000].keypoints_m + np.array([0.0, -0.15, 0.0]),
        9999: np.zeros((6, 3)),
    }
    error = tracking_error(estimates, truth)
    assert error["mean_3d_error_m"] == pytest.approx(0.1)
    assert error["error_by_segment_m"] == pytest.approx({"wave": 0.05, "neutral": 0.15})
    assert error["error_by_keypoint_m"] == pytest.approx(dict.fromkeys(KEYPOINT_NAMES, 0.1))
    along = [error[f"{name}_error_m"] for name in ("lateral", "vertical", "depth")]
    assert along == pytest.approx([0.015, 0.075, 0.02])


def test_estimates_of_another_session_are_refused(tmp_path: Path) -> None:
    truth = load_ground_truth(write(tmp_path, truth_data()))
    with pytest.raises(CardboxError, match="ground truth"):
        tracking_error({1: np.zeros((6, 3))}, truth)
