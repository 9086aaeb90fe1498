"""The demo's report, of results that are the truth, or differ from it by a known way."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth
from cardbox_tracker.ros.demo.run import figures, write_report
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

LAST = 24
"""So many images of the session's end are expected."""
BODY = BodyModel.of(hip_height_m=-0.51)


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> GroundTruth:
    session = tmp_path_factory.mktemp("demo") / "session"
    synthesize_session(session, "bow", form=SessionFormat(4.0, 160, 120), body=BODY)
    return load_ground_truth(session / "ground_truth.json")


def test_a_demo_that_missed_most_images_fails_after_its_report(
    truth: GroundTruth, tmp_path: Path
) -> None:
    stamps = sorted(truth.frames)[-LAST:]
    tracker = Tracker(BODY, Camera(64, 48, 66.0, 66.0, 31.5, 23.5))
    with result_bag(tmp_path / "bag", "camera", draw=draw_sharp_overlay) as add:
        for number, stamp in enumerate(stamps):
            true, picture = truth.frames[stamp], np.zeros((48, 64), np.uint8)
            found = Estimate(TRACKING, true.posture, np.full(12, 0.1), true.keypoints_m, 10, 0.9)
            is_found = number < LAST // 2 - 1
            frame = RecordedFrame(stamp, number / 4, picture, picture)
            add(frame, found if is_found else Estimate(LOST), tracker)
    with pytest.raises(CardboxError, match=f"only {LAST // 2 - 1} of {LAST} images were tracked"):
        write_report(tmp_path, truth, stamps[0], {"fps": 29.5, "initialization_iou": 0.87})
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["fps"], report["frames"]) == (29.5, LAST)
    assert report["mean_3d_error_m"] == pytest.approx(0.0, abs=1e-6)
    assert cv2.imread(str(tmp_path / "angles.png")) is not None
    assert cv2.VideoCapture(str(tmp_path / "overlay.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == LAST


def test_errors_and_lost_images_are_counted(truth: GroundTruth) -> None:
    stamps = sorted(truth.frames)[-LAST:]
    points_m = np.array([truth.frames[stamp].keypoints_m for stamp in stamps])
    points_m += [0.03, 0.0, 0.04]
    points_m[:5] = np.nan
    results = Results(
        Path("bag"),
        np.array(stamps),
        np.arange(LAST, dtype=float),
        ("lost",) * 5 + ("uncertain",) * 3 + ("tracking",) * (LAST - 8),
        dict(zip(POINT_COLUMNS, points_m.reshape(LAST, -1).T, strict=True)),
        {},
        (BODY,) * LAST,
    )
    report = figures(results, truth, stamps[2])
    assert (report["frames"], report["frames_tracked"]) == (LAST - 2, LAST - 5)
    assert (report["frames_uncertain"], report["cameras"]) == (3, 1)
    assert report["mean_3d_error_m"] == pytest.approx(0.05)
    assert report["lateral_error_m"] == pytest.approx(0.03)
    assert report["vertical_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert report["depth_error_m"] == pytest.approx(0.04)
    assert set(report["error_by_segment_m"]) <= {"neutral", "bow"}
