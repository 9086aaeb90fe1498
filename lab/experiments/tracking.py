"""Track a session many times, and summarize the errors (experiments 1 to 3).

Every run starts anew with a generator seeded by (seed, number of the run). The state ``lost`` is
switched off, because it would leave out the images in which a strategy is worst.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.evaluation.metrics import align, angle_errors_deg, distances_m
from cardbox_tracker.person.posture import N_JOINTS, TURNS
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.tracker import Tracker
from lab.experiments.models import make_silhouette_term
from lab.experiments.parallel import Call
from lab.experiments.sessions import Session

FloatArray = NDArray[np.float64]

AXES = ("lateral", "vertical", "depth")
"""The axes x, y and z of the camera optical frame."""

RUNS_A_CALL = 10
# More frames than any session has.
_NEVER = 1_000_000


@dataclass(frozen=True)
class Setting:
    """Settings of the tracker for some runs on a session.

    Attributes:
        config: settings of the tracker.
        seed: of the evaluation.
        every: stride through the images; 3 makes the motion three times as fast.
        model: the term of the silhouette, see ``models.make_silhouette_term``.
    """

    config: TrackerConfig
    seed: int
    every: int = 1
    model: str = "compiled"


class Runs(NamedTuple):
    """Results of r runs over n images; an image without a person is NaN in every run.

    Attributes:
        postures: estimates, (r, n, 12), rad and metres.
        keypoints_m: (r, n, 6, 3), metres in the optical frame.
        costs_px: equation (2) of the estimates, (r, n).
    """

    postures: FloatArray
    keypoints_m: FloatArray
    costs_px: FloatArray


def comparable(config: TrackerConfig) -> TrackerConfig:
    """Return ``config`` without the states that would leave out images."""
    any_size = replace(config.whole_body, largest_person=1000.0)
    return replace(config, lost_iou=0.0, lost_frames=_NEVER, whole_body=any_size)


def calls_of(session: Session, setting: Setting, runs: int) -> list[Call]:
    """Return calls for the runs 0 to ``runs`` - 1 of ``setting``."""
    return [
        Call(track_runs, (session, setting, first, min(first + RUNS_A_CALL, runs)))
        for first in range(0, runs, RUNS_A_CALL)
    ]


def track_runs(session: Session, setting: Setting, first: int, end: int) -> Runs:
    """Track the session in the runs ``first`` to ``end`` - 1 of ``setting``."""
    silhouettes = session.silhouettes[:: setting.every]
    shape = (end - first, len(silhouettes))
    postures = np.full((*shape, N_JOINTS), np.nan)
    keypoints_m = np.full((*shape, 6, 3), np.nan)
    costs_px = np.full(shape, np.nan)
    cost = make_silhouette_term(setting.model, session.body, session.camera)
    for run in range(first, end):
        rng = np.random.default_rng([setting.seed, run])
        tracker = Tracker(session.body, session.camera, setting.config, rng, cost)
        for i, silhouette in enumerate(silhouettes):
            estimate = tracker.track(silhouette)
            if estimate.posture is None:
                continue
            postures[run - first, i] = estimate.posture
            keypoints_m[run - first, i] = estimate.keypoints_m
            costs_px[run - first, i] = estimate.cost_px
    return Runs(postures, keypoints_m, costs_px)


def stacked(runs: Sequence[Runs]) -> Runs:
    """Return the runs of all calls of one setting."""
    return Runs(*(np.concatenate(arrays) for arrays in zip(*runs, strict=True)))


@dataclass(frozen=True)
class MotionRuns:
    """Runs and truth of one motion, over its n images with a person and truth.

    Attributes:
        runs: the estimates.
        time_s: seconds from the motion's start, (n,).
        keypoints_m: true keypoints, (n, 6, 3).
        postures: true postures, (n, 12), or NaN.
        torso_rad: true roll, pitch, yaw, (n, 3), or NaN.
    """

    runs: Runs
    time_s: FloatArray
    keypoints_m: FloatArray
    postures: FloatArray
    torso_rad: FloatArray


def select_motion(runs: Runs, session: Session, motion: str, every: int = 1) -> MotionRuns:
    """Return runs and truth of the images of ``motion``."""
    chosen = (session.segments == motion) & ~np.isnan(session.keypoints_m[:, 0, 0])
    chosen = chosen[::every] & ~np.any(np.isnan(runs.costs_px), axis=0)
    time_s = session.time_s[::every][chosen]
    return MotionRuns(
        Runs(runs.postures[:, chosen], runs.keypoints_m[:, chosen], runs.costs_px[:, chosen]),
        time_s - time_s[0],
        session.keypoints_m[::every][chosen],
        session.postures[::every][chosen],
        session.torso_rad[::every][chosen],
    )


def summarize(motion: MotionRuns) -> dict[str, Any]:
    """Return the figures of experiments 1 to 3 of one motion and one strategy.

    ``std_dof`` is the standard deviation over the runs, averaged over the images, rad (metres for
    ``torso_y``); all others are means over runs and images.
    """
    runs = motion.runs
    errors_m = distances_m(runs.keypoints_m, motion.keypoints_m)
    aligned = distances_m(align(runs.keypoints_m, motion.keypoints_m), motion.keypoints_m)
    return {
        "mean_cost_px": float(runs.costs_px.mean()),
        "error_m": _by(KEYPOINT_NAMES, errors_m.mean(axis=(0, 1))),
        "std_dof": _by(JOINT_NAMES, stddev_over_runs(runs.postures).mean(axis=0)),
        "mean_dof": _by(JOINT_NAMES, runs.postures.mean(axis=(0, 1))),
        "mpjpe_m": float(errors_m.mean()),
        "pa_mpjpe_m": float(aligned.mean()),
        "axis_error_m": errors_along_axes_m(runs.keypoints_m, motion.keypoints_m),
        "joint_angle_error_deg": _angle_errors(motion),
        "stderr_cost_px": _standard_error(runs.costs_px.mean(axis=1)),
        "stderr_mpjpe_m": _standard_error(errors_m.mean(axis=(1, 2))),
        "runs": len(runs.costs_px),
        "frames": runs.costs_px.shape[1],
    }


def errors_along_axes_m(estimates_m: FloatArray, truth_m: FloatArray) -> dict[str, float]:
    """Return the mean absolute error along each of ``AXES`` of joints (..., k, 3), metres."""
    along = np.abs(estimates_m - truth_m).mean(axis=tuple(range(np.ndim(estimates_m) - 1)))
    return dict(zip(AXES, along.tolist(), strict=True))


def stddev_over_runs(values: FloatArray) -> FloatArray:
    """Return the sample standard deviation (...) of ``values`` (runs, ...) over the runs."""
    stddev: FloatArray = np.std(values, axis=0, ddof=1)
    return stddev


def brief(motion: MotionRuns) -> dict[str, float]:
    """Return the figures that compare settings."""
    errors_m = distances_m(motion.runs.keypoints_m, motion.keypoints_m)
    return {
        "mean_cost_px": float(motion.runs.costs_px.mean()),
        "mpjpe_m": float(errors_m.mean()),
        "elbow_hand_error_m": float(errors_m[..., [1, 2, 4, 5]].mean()),
        "stderr_mpjpe_m": _standard_error(errors_m.mean(axis=(1, 2))),
        "stderr_cost_px": _standard_error(motion.runs.costs_px.mean(axis=1)),
        "mean_std_angles_rad": float(stddev_over_runs(motion.runs.postures)[:, 1:].mean()),
    }


def mean_brief(figures: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the means over motions of the figures of :func:`brief`."""
    means = {name: float(np.mean([f[name] for f in figures])) for name in figures[0]}
    for name in ("stderr_mpjpe_m", "stderr_cost_px"):
        # The motions are tracked separately, so their errors are independent.
        squares = np.sum([f[name] ** 2 for f in figures])
        means[name] = float(np.sqrt(squares) / len(figures))
    return means


def per_frame(motion: MotionRuns) -> dict[str, FloatArray]:
    """Return the curves of experiments 1 to 3, by column name, each (n,): means over the runs."""
    runs = motion.runs
    errors_m = distances_m(runs.keypoints_m, motion.keypoints_m).mean(axis=0)
    columns = {"time_s": motion.time_s, "cost_px": runs.costs_px.mean(axis=0)}
    columns |= {f"error_{name}_m": errors_m[:, i] for i, name in enumerate(KEYPOINT_NAMES)}
    mean, stddev = runs.postures.mean(axis=0), stddev_over_runs(runs.postures)
    for i, name in enumerate(JOINT_NAMES):
        columns[f"mean_{name}"] = mean[:, i]
        columns[f"std_{name}"] = stddev[:, i]
    return columns


def _angle_errors(motion: MotionRuns) -> dict[str, float]:
    """Return the mean error of each angle with known truth: all, the torso's, or none."""
    if not np.any(np.isnan(motion.postures)):
        names, truth = JOINT_NAMES[1:], motion.postures[:, 1:]
    elif not np.any(np.isnan(motion.torso_rad)):
        names, truth = JOINT_NAMES[TURNS], motion.torso_rad
    else:
        return {}
    estimates = motion.runs.postures[..., 1 : 1 + len(names)]
    return _by(names, angle_errors_deg(estimates, truth).mean(axis=(0, 1)))


def _by(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _standard_error(run_means: FloatArray) -> float:
    return float(np.std(run_means, ddof=1) / np.sqrt(len(run_means)))
