"""Scores and robots of a tracked session beside those of its true joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.ergonomics.rula import RulaConfig, ScoreDistribution
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from lab.evaluation.angles import true_postures
from lab.tools import retarget_accuracy, retarget_live, rula_accuracy

BODY = body_from_proportions(1.75, 2.0, 0.4, 0.0)
COUNT = 20
ROBOT = load_robot(Path(__file__).parents[3] / "config" / "example_arm.urdf")


def postures() -> np.ndarray:
    """Both arms rise sideways."""
    found = np.tile(reference_posture("front"), (COUNT, 1))
    found[:, [4, 8]] = np.linspace(0.2, 1.4, COUNT)[:, None]
    return found


def session() -> Any:
    points = session_camera().reference_to_optical(pose(BODY.rigid, postures()).keypoints_m)
    return SimpleNamespace(
        name="made up",
        stamps_ns=np.arange(COUNT, dtype=np.int64) * 10**8,
        keypoints_m=points,
        torso_rad=np.zeros((COUNT, 3)),
        truth=SimpleNamespace(pitch_deg=0.0),
        has_references=True,
    )


def tracked(*changes: Callable[[int, Estimate], Estimate]) -> Callable[..., None]:
    """Stand in for track_session: says the truth, changed."""

    def run(session: Any, *_: Any, observe: Callable[..., None]) -> None:
        tracker = SimpleNamespace(body=BODY, sample=lambda estimate, n, _: estimate.posture[None])
        for i, posture in enumerate(postures()):
            estimate = Estimate(TRACKING, posture, np.full(12, 1e-6))
            for change in changes:
                estimate = change(i, estimate)
            observe(0, i * 10**8, estimate, tracker)

    return run


def test_the_true_postures_are_those_of_the_keypoints() -> None:
    np.testing.assert_allclose(true_postures(session()), postures(), atol=1e-9)


def test_whoever_measures_the_truth_has_its_scores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rula_accuracy, "track_session", tracked())
    errors = rula_accuracy.score_errors(session(), default_preset(), 0, {"task": RulaConfig()})[
        "task"
    ]
    for way in ("mean posture", "normal", "particles", "whole deviation"):
        assert errors[way].difference == pytest.approx(0.0, abs=0.05)
        assert errors[way].equal == errors[way].within_one == 1.0
    assert errors["always the same"].equal < 1.0


def test_score_errors_are_counted() -> None:
    chances = np.array([0, 0.5, 0.3, 0, 0, 0, 0.2])
    one = ScoreDistribution(chances, chances, chances)
    error = rula_accuracy.score_error([one, one, one], np.array([2, 3, 7]))
    assert (error.equal, error.within_one) == pytest.approx((1 / 3, 2 / 3))
    assert error.chance_of_truth == pytest.approx((0.5 + 0.3 + 0.2) / 3)
    assert error.difference == pytest.approx((1.3 + 0.3 + 3.7) / 3)
    assert (error.above, error.true_above) == pytest.approx((0.2, 1 / 3))
    assert (error.low, error.true_low) == pytest.approx((0.5, 1 / 3))


def test_a_robot_that_can_points_as_the_person() -> None:
    """The example arm has a human arm's joints, and limits that these postures stay within."""
    postures = np.zeros((3, 12))
    postures[:, 8], postures[:, 11] = 0.4, (0.5, 0.7, 0.9)
    body = body_from_proportions(1.75, 2.0)
    cells = retarget_accuracy.row_of(ROBOT, "arm", "right", body, postures).split(" | ")
    assert cells[:2] == ["| arm", "right"]
    assert all(float(cell.split(" / ")[1].rstrip("°")) < 8.0 for cell in cells[2:5])


def test_a_faster_robot_lags_less() -> None:
    """An arm that rises at 1.5 rad/s for a second is followed late by the filter and an image."""
    postures = np.zeros((16, 12))
    postures[:, 8] = 0.4 + np.minimum(np.arange(16) / 10, 1.0) * 1.0
    motions = [(np.arange(16, dtype=np.int64) * 10**8, postures)]
    body = body_from_proportions(1.75, 2.0)
    lags = []
    for speed in (1.0, 8.0):
        cells = retarget_accuracy.lag_of(ROBOT, "arm", body, motions, speed).split(" | ")
        assert cells[:2] == ["| arm", f"{speed:g}"]
        lags.append(float(cells[3].split()[0]))
    assert 0.1 <= lags[1] <= 0.25 and lags[1] <= lags[0]


@pytest.mark.parametrize("tool", [rula_accuracy, retarget_accuracy, retarget_live])
def test_the_documents_have_the_tables_of_today(tool: Any) -> None:
    text = tool.DOCUMENT.read_text(encoding="utf-8")
    rows = text.split(tool.BEGIN)[1].split(tool.END)[0].strip().splitlines()
    assert rows[0] == f"| {' | '.join(tool._HEAD)} |"
    assert len(rows) > 2
