"""Figures of experiments 1 to 3, by hand-made runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.config import default_preset, paper_preset
from cardbox_tracker.tracking.tracker import Tracker
from lab.experiments.sessions import Session
from lab.experiments.tracking import (
    RUNS_A_CALL,
    MotionRuns,
    Runs,
    Setting,
    brief,
    calls_of,
    comparable,
    errors_along_axes_m,
    mean_brief,
    per_frame,
    select_motion,
    stacked,
    stddev_over_runs,
    summarize,
)


def hand_made() -> MotionRuns:
    """Two runs over two images; the second run is off by known amounts."""
    truth_m = np.random.default_rng(0).normal(0.0, 0.5, (2, 6, 3))
    keypoints_m = np.stack([truth_m, truth_m + np.array([0.0, 0.0, 0.2])])
    postures = np.zeros((2, 2, 12))
    postures[1, :, 0] = 0.02
    postures[1, :, 2] = np.radians(30.0)
    costs = np.array([[100.0, 200.0], [300.0, 400.0]])
    return MotionRuns(
        Runs(postures, keypoints_m, costs, np.full((2, 2), 600.0), np.full((2, 2), np.nan)),
        np.array([0.0, 0.1]),
        truth_m,
        np.zeros((2, 12)),
    )


def test_summary_by_hand() -> None:
    figures = summarize(hand_made())
    assert figures["mean_cost_px"] == pytest.approx(250.0)
    assert list(figures["error_m"]) == list(KEYPOINT_NAMES)
    assert figures["error_m"] == pytest.approx(dict.fromkeys(KEYPOINT_NAMES, 0.1))
    assert figures["mpjpe_m"] == pytest.approx(0.1)
    assert figures["pa_mpjpe_m"] == pytest.approx(0.0, abs=1e-9)
    assert figures["axis_error_m"] == pytest.approx({"lateral": 0.0, "vertical": 0.0, "depth": 0.1})
    assert list(figures["std_dof"]) == list(JOINT_NAMES)
    assert figures["std_dof"]["torso_y"] == pytest.approx(0.02 / np.sqrt(2))
    assert figures["std_dof"]["torso_pitch"] == pytest.approx(np.radians(30) / np.sqrt(2))
    assert figures["std_dof"]["left_elbow_flexion"] == 0.0
    assert figures["stderr_cost_px"] == pytest.approx(100.0)
    assert (figures["runs"], figures["frames"]) == (2, 2)


def test_curves_are_means_over_runs() -> None:
    columns = per_frame(hand_made())
    np.testing.assert_allclose(columns["cost_px"], [200.0, 300.0])
    np.testing.assert_allclose(columns["error_left_hand_m"], [0.1, 0.1])
    np.testing.assert_allclose(columns["mean_torso_pitch"], np.radians([15.0, 15.0]))


def test_brief_figures_and_their_mean_over_motions() -> None:
    figures = brief(hand_made())
    assert figures["mpjpe_m"] == pytest.approx(0.1)
    assert figures["stderr_mpjpe_m"] == pytest.approx(0.1)
    assert (figures["runs"], figures["ratings"]) == (2, 600.0)
    assert "effective_particles" not in figures
    # One run tracks both motions and is off in both; where runs are off in turns, the mean is sure.
    there = hand_made()
    turned = replace(there, runs=Runs(*(values[::-1] for values in there.runs)))
    assert mean_brief([there, there])["stderr_mpjpe_m"] == pytest.approx(0.1)
    mean = mean_brief([there, turned])
    assert mean["mpjpe_m"] == pytest.approx(0.1)
    assert mean["stderr_mpjpe_m"] == pytest.approx(0.0)


def test_images_of_other_segments_or_without_a_person_do_not_count(session: Session) -> None:
    n = len(session.silhouettes)
    costs = np.full((2, n), 7.0)
    (bowing,) = np.nonzero(session.segments == "bow")
    costs[:, bowing[3]] = np.nan
    runs = Runs(np.zeros((2, n, 12)), np.zeros((2, n, 6, 3)), costs, costs, costs)
    chosen = select_motion(runs, session, "bow")
    expected = np.delete(bowing, 3)
    assert chosen.runs.costs_px.shape == (2, len(expected))
    np.testing.assert_array_equal(chosen.keypoints_m, session.keypoints_m[expected])
    assert chosen.time_s[0] == 0.0


def test_no_image_is_left_out_as_lost() -> None:
    config = comparable(default_preset())
    assert (config.lost_iou, config.lost_frames) == (0.0, 1_000_000)
    assert comparable(paper_preset()).torso == paper_preset().torso


def test_runs_are_those_of_the_tracker(session: Session) -> None:
    """Each run by itself, with its own seed; a stride leaves images out."""
    config = comparable(paper_preset().with_particles(20))
    calls = calls_of(session, Setting(config, 4, every=2), RUNS_A_CALL + 1)
    runs = stacked([call.function(*call.arguments) for call in calls])
    assert len(calls) == 2
    assert runs.postures.shape == (RUNS_A_CALL + 1, (len(session.silhouettes) + 1) // 2, 12)
    rng = np.random.default_rng([4, RUNS_A_CALL])
    tracker = Tracker(session.body, session.camera, config, rng)
    for silhouette, posture, cost in zip(
        session.silhouettes[::2], runs.postures[-1], runs.costs_px[-1], strict=True
    ):
        estimate = tracker.track(silhouette)
        np.testing.assert_array_equal(estimate.posture, posture)
        assert estimate.cost_px == cost
    assert not np.array_equal(runs.postures[0], runs.postures[1])


def test_errors_along_axes_by_hand() -> None:
    truth = np.ones((2, 1, 3))
    estimates = truth + np.array([[[0.1, -0.2, 0.0]], [[-0.3, 0.0, 0.8]]])
    assert errors_along_axes_m(estimates, truth) == pytest.approx(
        {"lateral": 0.2, "vertical": 0.1, "depth": 0.4}
    )


def test_standard_deviation_is_that_of_a_sample_of_runs() -> None:
    values = np.array([[1.0, 5.0], [3.0, 5.0], [5.0, 5.0]])
    np.testing.assert_allclose(stddev_over_runs(values), [2.0, 0.0])
