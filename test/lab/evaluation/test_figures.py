"""The figures of a run, of estimates whose errors are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.truth import GroundTruth
from lab.evaluation.figures import figures
from lab.evaluation.session import RecordedSession
from lab.evaluation.tracking import SessionRun

BODY = BodyModel.of(hip_height_m=-0.5)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
N = 20


@pytest.fixture
def postures() -> np.ndarray:
    """A slow wave of both arms."""
    postures = np.zeros((N, 12))
    postures[:, 4] = postures[:, 8] = np.linspace(0.2, 0.8, N)
    return postures


@pytest.fixture
def session(postures: np.ndarray) -> RecordedSession:
    truth = GroundTruth({}, {}, 0, 2.0, 0.0, "left")
    return RecordedSession(
        "hand_made",
        Path("bag"),
        None,
        truth,
        {},
        0.0,
        np.arange(N, dtype=np.int64) * 66_666_667,
        np.array(["low"] * 10 + ["high"] * 10),
        CAMERA.reference_to_optical(pose(BODY.rigid, postures).keypoints_m),
        np.zeros((N, 3)),
        {"aligned": 7.0},
        11.0,
    )


def run_of(session: RecordedSession, postures: np.ndarray, **changes: Any) -> SessionRun:
    values = {
        "body": BODY,
        "failure": "",
        "states": np.full(N, "tracking", dtype="<U16"),
        "keypoints_m": session.keypoints_m.copy(),
        "postures": postures.copy(),
        "stddevs": np.full((N, 12), 0.1),
        "keypoint_states": np.full((N, 6), "tracked"),
        "chances": np.full((N, 6), 0.1),
        "milliseconds": np.full(N, 2.0),
    }
    return SessionRun(**{**values, **changes})


def test_the_truth_has_no_error(session: RecordedSession, postures: np.ndarray) -> None:
    found = figures(session, run_of(session, postures))
    for name in (
        "absolute",
        "aligned",
        "pa",
        "hand_depth",
        "acceleration",
        "acceleration_beside",
    ):
        assert found[name] == pytest.approx(0.0, abs=1e-9)
    assert (found["frames"], found["without_estimate"], found["far"]) == (N, 0, 0)
    assert found["states"] == {"tracking": N}
    # This truth has no reference posture, so nothing says how high the joints are in it.
    assert np.isnan(found["lengths"].pop("joint_height"))
    assert all(ratio == pytest.approx(1.0) for ratio in found["lengths"].values())
    assert all(share == 1.0 for share in found["coverage"].values())
    assert found["ms"] == 2.0


def test_a_shift_is_no_aligned_error(session: RecordedSession, postures: np.ndarray) -> None:
    shifted = session.keypoints_m + np.array([0.03, -0.04, 0.12])
    found = figures(session, run_of(session, postures, keypoints_m=shifted))
    assert found["absolute"] == pytest.approx(13.0)
    assert found["aligned"] == pytest.approx(0.0, abs=1e-9)
    assert found["elbow_depth"] == pytest.approx(12.0)


def test_one_hand_that_is_off(session: RecordedSession, postures: np.ndarray) -> None:
    points = session.keypoints_m.copy()
    points[:10, 2, 2] += 0.6  # the left hand, in the first motion
    found = figures(session, run_of(session, postures, keypoints_m=points))
    assert found["aligned_hand"] == pytest.approx(15.0)
    assert found["aligned"] == pytest.approx(5.0)
    assert found["far"] == 0


def test_what_is_far_off_is_counted(session: RecordedSession, postures: np.ndarray) -> None:
    points = session.keypoints_m.copy()
    points[:4] += (0.0, 0.0, 0.4)
    states = np.full(N, "tracking", dtype="<U16")
    states[:3] = "uncertain"
    found = figures(session, run_of(session, postures, keypoints_m=points, states=states))
    assert (found["far"], found["far_but_tracking"]) == (4, 1)


def test_missing_estimates_are_counted(session: RecordedSession, postures: np.ndarray) -> None:
    points = session.keypoints_m.copy()
    points[5] = np.nan
    found = figures(session, run_of(session, postures, keypoints_m=points))
    assert found["without_estimate"] == 1
    assert found["absolute"] == pytest.approx(0.0, abs=1e-9)
    assert found["acceleration"] == pytest.approx(0.0, abs=1e-6)


def test_the_acceleration_error_by_hand(session: RecordedSession, postures: np.ndarray) -> None:
    points = session.keypoints_m.copy()
    points[::2, :, 0] += 0.001  # every other image 1 mm to the right
    found = figures(session, run_of(session, postures, keypoints_m=points))
    # Second differences of +-2 mm at 15 Hz.
    assert found["acceleration"] == pytest.approx(0.002 * 15.0**2, rel=1e-4)
    # All joints shake alike.
    assert found["acceleration_beside"] == pytest.approx(0.0, abs=1e-6)


def test_coverage_counts_two_standard_deviations(
    session: RecordedSession, postures: np.ndarray
) -> None:
    off = postures.copy()
    off[:5, 4] += 0.25  # 2.5 standard deviations in a quarter of the images
    off[:, 5] += 0.15
    found = figures(session, run_of(session, off))["coverage"]
    assert found["left_shoulder_abduction"] == pytest.approx(0.75)
    assert found["left_shoulder_flexion"] == 1.0
    assert found["torso_pitch"] == 1.0


def test_a_failed_initialization_has_no_errors(
    session: RecordedSession, postures: np.ndarray
) -> None:
    nothing = np.full((N, 6, 3), np.nan)
    run = run_of(session, postures, body=None, failure="nobody is there", keypoints_m=nothing)
    found = figures(session, run)
    assert found["failure"] == "nobody is there"
    assert found["without_estimate"] == N
    assert "absolute" not in found
