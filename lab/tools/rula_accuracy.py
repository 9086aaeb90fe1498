"""Compare RULA scores with those of the true joints, as a table for ``docs/ergonomics.md``.

python -m lab.tools.rula_accuracy SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The first camera of a session of
real people tracks as in a film, with the detector's masks and points; their true necks are not
known and count as declared. The table of the means replaces that between the marks in the document;
the errors of each session are printed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.ergonomics.rula import (
    PARTS,
    RULA,
    SAMPLES,
    RulaConfig,
    ScoreArray,
    ScoreDistribution,
    measured_parts,
    neck_samples,
    rula_scores,
    sampled_scores,
    score_distribution,
)
from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import SHOULDERS, Group, rows_of
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.search.particles import normal_postures
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.angles import comparable, true_postures
from lab.evaluation.people import torso_angles
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import ALL_INPUTS, DETECTOR, InputSelection, track_session
from lab.pages import replaced, row, table

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "ergonomics.md"
BEGIN, END = "<!-- rula-accuracy:begin -->", "<!-- rula-accuracy:end -->"
TASKS = {
    "no load": RulaConfig(),
    "2 to 10 kg held": RulaConfig(arm_load=2, arm_muscle_use=1, body_load=2, body_muscle_use=1),
}
LOW = 2
"""Highest score that is acceptable."""
_HEAD = (
    "session",
    "task",
    "score of",
    "mean difference",
    "equal",
    "within 1",
    "chance of the true score",
    f"time at 1 to {LOW}, true",
    f"time above {RULA.above}, true",
)
WAYS = ("mean posture", "normal", "particles", "whole deviation", "always the same")
"""Sources of a score: the mean posture; mean and deviations, as in commands and node; particles;
and these with the whole deviation, and the most frequent true score of the session."""


class ScoreError(NamedTuple):
    """Errors of scores over the images with a true score."""

    difference: float  #: mean absolute difference of the expected score
    equal: float  #: share of images whose likeliest score is the true one
    within_one: float  #: share of images where it is at most 1 off
    chance_of_truth: float  #: mean chance that the distribution gives the true score
    low: float  #: mean chance of a score up to ``LOW``
    true_low: float  #: share of images whose true score is up to ``LOW``
    above: float  #: mean chance of a score above ``RULA.above``
    true_above: float  #: share of images whose true score is above ``RULA.above``


def score_errors(
    session: RecordedSession, config: TrackerConfig, seed: int, tasks: Mapping[str, RulaConfig]
) -> dict[str, dict[str, ScoreError]]:
    """Track a session; return the error of each of ``WAYS`` for each of the ``tasks``.

    Raises:
        CardboxError: the recording cannot be read.
        ValueError: the truth lacks the torso's angles, or nobody was tracked.
    """
    found: dict[int, dict[tuple[str, str], ScoreDistribution]] = {}
    rng = np.random.default_rng(seed)
    body: list[BodyModel] = []

    def observe(_: int, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> None:
        if estimate.posture is None or estimate.posture_stddev is None:
            return
        body[:] = [tracker.body]
        normal = normal_postures(estimate.posture, estimate.posture_stddev, SAMPLES, rng)
        particles = tracker.sample(estimate, SAMPLES, rng)
        joints = estimate.joints.copy()
        # The true flexion of the wrists is not known.
        joints[:, rows_of(Group.HAND)] = np.nan
        angles, deviations = joints[:, PARTS["neck"]]
        for task, rula in tasks.items():
            drawn = [
                sampled_scores(tracker.body, joints, postures, rula, rng)[0]
                for postures in (normal, particles)
            ]
            mean = np.eye(RULA.highest)[drawn[0].of_mean - 1]
            necks = None
            if "neck" in measured_parts(joints):
                necks = neck_samples(angles, deviations, SAMPLES, rng)
            whole = score_distribution(tracker.body, particles, rula, necks)
            ways = ScoreDistribution(mean, mean, mean), *drawn, whole
            seen = found.setdefault(stamp_ns, {})
            seen |= {(task, way): one for way, one in zip(WAYS, ways, strict=False)}

    inputs = ALL_INPUTS
    if not session.has_references:
        inputs = InputSelection(silhouettes=DETECTOR, points=Detector.installed())
    track_session(session, config, (seed,), inputs, observe=observe)
    known = comparable(session, found)
    stamps = session.stamps_ns[known].tolist()
    errors: dict[str, dict[str, ScoreError]] = {}
    for task, rula in tasks.items():
        truth = true_scores(session, body[0], rula)[known]
        same = np.eye(RULA.highest)[np.bincount(truth).argmax() - 1]
        constant = [ScoreDistribution(same, same, same)] * len(truth)
        of_way = [[found[s][task, way] for s in stamps] for way in WAYS[:-1]]
        errors[task] = {
            way: score_error(scores, truth)
            for way, scores in zip(WAYS, [*of_way, constant], strict=True)
        }
    return errors


def true_scores(session: RecordedSession, body: BodyModel, rula: RulaConfig) -> ScoreArray:
    """Return the grand scores (n,) of the true joints with the lengths of ``body``."""
    postures = true_postures(session)
    return rula_scores(body, postures, rula)["grand"]


def score_error(scores: list[ScoreDistribution], truth: ScoreArray) -> ScoreError:
    """Compare distributions with the true scores (n,)."""
    means = np.array([one.mean for one in scores])
    likeliest = np.array([one.likeliest for one in scores])
    chances: FloatArray = np.array([one.grand for one in scores])
    off = np.abs(likeliest - truth)
    return ScoreError(
        difference=float(np.abs(means - truth).mean()),
        equal=float((off == 0).mean()),
        within_one=float((off <= 1).mean()),
        chance_of_truth=float(chances[np.arange(len(truth)), truth - 1].mean()),
        low=float(chances[:, :LOW].sum(axis=1).mean()),
        true_low=float((truth <= LOW).mean()),
        above=float(chances[:, RULA.above :].sum(axis=1).mean()),
        true_above=float((truth > RULA.above).mean()),
    )


def row_of(name: str, task: str, way: str, error: ScoreError) -> list[str]:
    """Return one row of the table."""
    return [
        name,
        task,
        way,
        f"{error.difference:.2f}",
        *(f"{share:.0%}" for share in (error.equal, error.within_one, error.chance_of_truth)),
        f"{error.low:.0%}, {error.true_low:.0%}",
        f"{error.above:.0%}, {error.true_above:.0%}",
    ]


def load(folder: Path) -> RecordedSession:
    """Return a session; that of a real person with one camera, and the torso of hips and shoulders.

    A trunk whose hips are not seen is taken as upright.

    Raises:
        CardboxError: the folder is not a session.
    """
    session = load_session(folder)
    if session.has_references:
        return session
    session = load_session(folder, session.truth.cameras[:1])
    if session.hips_m is None:
        down = -session.to_optical[:, 2]
        session = replace(session, hips_m=session.keypoints_m[:, SHOULDERS].mean(axis=1) + down)
    return replace(session, torso_rad=torso_angles(session))


def main(args: list[str] | None = None) -> int:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(args)
    found = {(task, way): list[ScoreError]() for task in TASKS for way in WAYS}
    for folder in given.sessions:
        session = load(folder)
        try:
            errors = score_errors(session, PRESETS["default"](), given.seed, TASKS)
        except ValueError as error:
            print(f"left out: {error}", file=sys.stderr)
            continue
        for task, way in found:
            found[task, way].append(errors[task][way])
        for task in TASKS:
            cells = row_of(session.name, task, "particles", errors[task]["particles"])
            print(row(cells), flush=True)
    every = (
        row_of("**mean**", *of, ScoreError(*np.mean(errors, axis=0).tolist()))
        for of, errors in found.items()
    )
    means = table(_HEAD, every)
    text = DOCUMENT.read_text(encoding="utf-8")
    write_file(DOCUMENT, replaced(text, f"\n{means}\n", BEGIN, END))
    print(means)
    return 0


if __name__ == "__main__":
    sys.exit(main())
