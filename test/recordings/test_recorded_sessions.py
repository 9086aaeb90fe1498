"""A recorded person, through 'cardbox initialize' and 'cardbox track', against ground truth."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.commands.main import main
from cardbox_tracker.measuring.config import InitializationResult
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.truth import load_ground_truth, tracking_error

# Exports and nodes have tests with person_a.
SESSION = Path(__file__).resolve().parents[3] / "shared" / "data" / "person_b"
MEAN_ERROR_M = 0.12
INITIALIZATION_IOU = 0.80
# Least share of keypoints in the state tracked, of shoulders and elbows, and most that are wrong.
LEAST_TRACKED, LEAST_OF_TRUNK, MOST_WRONG, FAR_M = 0.6, 0.9, 0.06, 0.30
# Least share of images that are sure, and most of these with a joint that is wrong.
LEAST_TRACKING, MOST_WRONG_IMAGES = 0.25, 0.03
BUT_HANDS = [0, 1, 3, 4]
# Nobody takes a posture, or leaves the image, to the frame.
MARGIN_S = 0.2


@pytest.mark.slow
def test_a_recorded_session_is_measured_and_tracked_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not SESSION.is_dir():
        pytest.skip("no recorded session person_b in ../shared/data")
    truth = load_ground_truth(SESSION / "ground_truth.json")
    spans = {
        segment: f"{start_s + MARGIN_S:g}:{end_s - MARGIN_S:g}"
        for segment, (start_s, end_s) in truth.spans.items()
    }
    recording = [str(SESSION / "bag"), "--background", spans["empty"]]
    model, table = tmp_path / "person.yaml", tmp_path / "person.csv"
    words = [word for n in ("front", "side", "arms") for word in (f"--{n}", spans[n])]
    words += ["--distance", f"{truth.distance_m}", "--camera-pitch-deg", f"{truth.pitch_deg}"]
    words += ["--side-turn", truth.side_turn, "--output", str(model)]
    results: list[InitializationResult] = []

    def measure(*args: Any) -> InitializationResult:
        results.append(initialize_body(*args))
        return results[-1]

    monkeypatch.setattr("cardbox_tracker.recordings.initialize.initialize_body", measure)
    assert main(["initialize", *recording, *words]) == 0
    iou = results[0].mean_iou
    assert iou >= INITIALIZATION_IOU
    assert load_body_model(model).placement.distance_m == truth.distance_m

    start_s = truth.spans["neutral"][0]
    words = ["--model", str(model), "--start", f"{start_s}", "--csv", str(table)]
    assert main(["track", *recording, *words]) == 0
    with table.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    estimates_m, states, tracked, doubted = {}, {}, {}, {}
    for row in rows:
        stamp_ns = int(row["stamp_ns"])
        states[stamp_ns] = row["state"]
        if row["state"] in ("tracking", "uncertain"):
            points = [float(row[f"{joint}_{axis}"]) for joint in KEYPOINT_NAMES for axis in "xyz"]
            estimates_m[stamp_ns] = np.array(points).reshape(6, 3)
            hands = {row[f"{side}_hand_state"] for side in ("left", "right")}
            doubted[stamp_ns] = hands & {"uncertain", "lost"}
            tracked[stamp_ns] = [row[f"{joint}_state"] == "tracked" for joint in KEYPOINT_NAMES]
    # Every image with somebody in it, to the last one.
    expected = [s for s in truth.frames if s >= truth.start_ns + round(start_s * 1e9)]
    assert all(states.get(s) in ("tracking", "uncertain") for s in expected)
    # Nothing but a hand that may be wrong by more than 30 cm makes an image uncertain.
    unsure = [s for s in expected if states[s] == "uncertain" and all(tracked[s][2::3])]
    assert len(unsure) <= 0.01 * len(expected)
    certain = [s for s in expected if states[s] == "tracking"]
    assert len(certain) >= LEAST_TRACKING * len(expected)
    assert not any(doubted[s] for s in certain)
    sure = np.array([tracked[s] for s in expected])
    # An outline hardly shows the depth of a hand, and hardly hides anything else.
    assert sure.mean() >= LEAST_TRACKED
    assert sure.mean(axis=0)[BUT_HANDS].min() >= LEAST_OF_TRUNK
    truths_m = np.array([truth.frames[s].keypoints_m for s in expected])
    off_m = np.linalg.norm(np.array([estimates_m[s] for s in expected]) - truths_m, axis=2)
    assert (off_m[sure] > FAR_M).mean() < MOST_WRONG
    beyond = [(off_m[expected.index(s)] > FAR_M).any() for s in certain]
    assert np.mean(beyond) <= MOST_WRONG_IMAGES
    # What is doubted is farther off, and no image is wrong as a whole, doubted or not.
    assert off_m[sure].mean() < off_m[~sure].mean()
    assert off_m.mean(axis=1).max() < FAR_M
    error = tracking_error(estimates_m, truth)
    mean_m = error["mean_3d_error_m"]
    motions = ", ".join(f"{n} {100 * e:.1f}" for n, e in error["error_by_segment_m"].items())
    print(f"IoU {iou:.2f}, mean error {100 * mean_m:.1f} cm ({motions})")
    assert mean_m < MEAN_ERROR_M
