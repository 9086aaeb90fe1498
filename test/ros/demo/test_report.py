"""The demo's report, of results that are the truth, or differ from it by a known way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.ros.demo.run import figures

LAST = 24
"""So many images of the session's end are expected."""


def test_errors_and_lost_images_are_counted(tmp_path: Path) -> None:
    session = tmp_path / "session"
    body = BodyModel.of(hip_height_m=-0.51)
    synthesize_session(session, "bow", form=SessionFormat(4.0, 160, 120), body=body)
    truth = load_ground_truth(session / "ground_truth.json")
    stamps = sorted(truth.frames)[-LAST:]
    points_m = np.array([truth.frames[stamp].keypoints_m for stamp in stamps])
    points_m += [0.03, 0.0, 0.04]
    points_m[:5] = np.nan
    results = Results(
        session,
        np.array(stamps),
        np.arange(LAST, dtype=float),
        ("lost",) * 5 + ("uncertain",) * 3 + ("tracking",) * (LAST - 8),
        dict(zip(POINT_COLUMNS, points_m.reshape(LAST, -1).T, strict=True)),
        {},
        (body,) * LAST,
    )
    report = figures(results, truth, stamps[2])
    assert (report["frames"], report["frames_tracked"]) == (LAST - 2, LAST - 5)
    assert (report["frames_uncertain"], report["cameras"]) == (3, 1)
    assert report["mean_3d_error_m"] == pytest.approx(0.05)
    assert report["lateral_error_m"] == pytest.approx(0.03)
    assert report["vertical_error_m"] == pytest.approx(0.0, abs=1e-9)
    assert report["depth_error_m"] == pytest.approx(0.04)
    assert set(report["error_by_segment_m"]) <= {"neutral", "bow"}  # type: ignore[call-overload]
