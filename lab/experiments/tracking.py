"""Track a session many times, and summarize the errors (experiments 1 to 3).

Every run starts anew with a generator seeded by (seed, number of the run). The state ``lost`` is
switched off, because it would leave out the images in which a strategy is worst.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.posture import N_JOINTS
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.hierarchy import Cycles, MakeHierarchy
from cardbox_tracker.search.resampling import gaussian_weights
from cardbox_tracker.terms.silhouette import SilhouetteObservation, SilhouetteTerm
from cardbox_tracker.terms.term import ArmCosts, Frame, TorsoCosts
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.metrics import align, distances_m
from lab.experiments.models import make_silhouette_term
from lab.experiments.parallel import Call
from lab.experiments.peers import Annealed, CmaEs, Flat
from lab.experiments.sessions import Session

FloatArray = NDArray[np.float64]

AXES = ("lateral", "vertical", "depth")
"""The axes x, y and z of the camera optical frame."""

PEERS: dict[str, MakeHierarchy] = {"flat": Flat, "annealed": Annealed, "cma_es": CmaEs}
"""Searches in the place of the paper's hierarchy, by name."""

RUNS_A_CALL = 10
# More frames than any session has.
_NEVER = 1_000_000


class CountingSilhouette(SilhouetteTerm):
    """Gives the costs of another term, so that searches are compared at equal numbers of ratings.

    Attributes:
        ratings: states rated so far: torsos, arms and whole postures.
    """

    def __init__(self, term: SilhouetteTerm) -> None:
        """Count the ratings of ``term``."""
        super().__init__(term.body, term.camera)
        self._term = term
        self.ratings = 0

    def observe(self, frame: Frame) -> SilhouetteObservation:
        """See :class:`SilhouetteTerm`."""
        return _Counting(frame, self._term.observe(frame), self)

    def count(self, costs: FloatArray) -> FloatArray:
        """Count and return ``costs`` (N,)."""
        self.ratings += len(costs)
        return costs


@dataclass(frozen=True)
class _Counting(SilhouetteObservation):
    frame: Frame
    seen: SilhouetteObservation
    counter: CountingSilhouette

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        rate = self.seen.torsos_beside(arms)
        return lambda torsos: self.counter.count(rate(torsos))

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        rate = self.seen.arms_beside(torso)
        return lambda side, arms: self.counter.count(rate(side, arms))

    def postures(self, postures: FloatArray) -> FloatArray:
        return self.counter.count(self.seen.postures(postures))

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        return self.seen.overlap(posture)


@dataclass(frozen=True)
class Setting:
    """Settings of the tracker for some runs on a session.

    Attributes:
        config: settings of the tracker.
        seed: of the evaluation.
        every: stride through the images; 3 makes the motion three times as fast.
        model: the term of the silhouette, see ``models.make_silhouette_term``.
        peer: one of ``PEERS``, or None for the filter of ``config``.
    """

    config: TrackerConfig
    seed: int
    every: int = 1
    model: str = "compiled"
    peer: str | None = None


class Runs(NamedTuple):
    """Results of r runs over n images; an image without a person is NaN in every run.

    Attributes:
        postures: estimates, (r, n, 12), rad and metres.
        keypoints_m: (r, n, 6, 3), metres in the optical frame.
        costs_px: equation (2) of the estimates, (r, n).
        ratings: costs that the search computed, (r, n).
        effective: effective sample size of the weights of torso and arms, 1 / sum w^2, mean over
            the filters, (r, n); NaN without weights.
    """

    postures: FloatArray
    keypoints_m: FloatArray
    costs_px: FloatArray
    ratings: FloatArray
    effective: FloatArray


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
    costs_px, ratings, effective = (np.full(shape, np.nan) for _ in range(3))
    cost = CountingSilhouette(make_silhouette_term(setting.model, session.body, session.camera))
    make_filter = None
    if setting.peer is not None:
        make_filter = partial(Cycles, make_hierarchy=PEERS[setting.peer])
    for run in range(first, end):
        rng = np.random.default_rng([setting.seed, run])
        tracker = Tracker(session.body, session.camera, setting.config, rng, cost, make_filter)
        for i, silhouette in enumerate(silhouettes):
            before = cost.ratings
            estimate = tracker.track(silhouette)
            if estimate.posture is None:
                continue
            postures[run - first, i] = estimate.posture
            keypoints_m[run - first, i] = estimate.keypoints_m
            costs_px[run - first, i] = estimate.cost_px
            ratings[run - first, i] = cost.ratings - before
            effective[run - first, i] = _effective(tracker, setting)
    return Runs(postures, keypoints_m, costs_px, ratings, effective)


def _effective(tracker: Tracker, setting: Setting) -> float:
    """Return the mean effective sample size of the paper's filters; NaN if they have no weights."""
    has_weights = setting.config.strategy != "drs" and setting.peer is None
    if not has_weights or not isinstance(tracker.filter, Cycles):
        return np.nan
    of = tracker.filter.hierarchy
    scale = tracker.camera.width * tracker.camera.height / (320 * 240)
    return float(
        np.mean(
            [
                1 / np.sum(gaussian_weights(one.costs, one.config.sigma_gamma_px * scale) ** 2)
                for one in (of.torso, *of.arms.values())
            ]
        )
    )


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
    """

    runs: Runs
    time_s: FloatArray
    keypoints_m: FloatArray
    postures: FloatArray


def select_motion(runs: Runs, session: Session, motion: str, every: int = 1) -> MotionRuns:
    """Return runs and truth of the images of ``motion``."""
    chosen = (session.segments == motion) & ~np.isnan(session.keypoints_m[:, 0, 0])
    chosen = chosen[::every] & ~np.any(np.isnan(runs.costs_px), axis=0)
    time_s = session.time_s[::every][chosen]
    return MotionRuns(
        Runs(*(values[:, chosen] for values in runs)),
        time_s - time_s[0],
        session.keypoints_m[::every][chosen],
        session.postures[::every][chosen],
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
        "mpjpe_m": float(errors_m.mean()),
        "pa_mpjpe_m": float(aligned.mean()),
        "axis_error_m": errors_along_axes_m(runs.keypoints_m, motion.keypoints_m),
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
    """Return the figures that compare settings; those that a setting does not have are left out."""
    errors_m = distances_m(motion.runs.keypoints_m, motion.keypoints_m)
    figures = {
        "mean_cost_px": float(motion.runs.costs_px.mean()),
        "mpjpe_m": float(errors_m.mean()),
        "stderr_mpjpe_m": _standard_error(errors_m.mean(axis=(1, 2))),
        "stderr_cost_px": _standard_error(motion.runs.costs_px.mean(axis=1)),
        "mean_std_angles_rad": float(stddev_over_runs(motion.runs.postures)[:, 1:].mean()),
        "runs": len(errors_m),
        "ratings": float(motion.runs.ratings.mean()),
        "effective_particles": float(motion.runs.effective.mean()),
    }
    return {name: value for name, value in figures.items() if not np.isnan(value)}


def mean_brief(motions: Sequence[MotionRuns]) -> dict[str, float]:
    """Return the means over motions of the figures of :func:`brief`."""
    figures = [brief(motion) for motion in motions]
    means = {name: float(np.mean([one[name] for one in figures])) for name in figures[0]}
    # In a recorded session, one run tracks all motions, so their errors depend on each other.
    errors_m = [
        distances_m(one.runs.keypoints_m, one.keypoints_m).mean(axis=(1, 2)) for one in motions
    ]
    costs_px = [one.runs.costs_px.mean(axis=1) for one in motions]
    means["stderr_mpjpe_m"] = _standard_error(np.mean(errors_m, axis=0))
    means["stderr_cost_px"] = _standard_error(np.mean(costs_px, axis=0))
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


def _by(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _standard_error(run_means: FloatArray) -> float:
    return float(np.std(run_means, ddof=1) / np.sqrt(len(run_means)))
