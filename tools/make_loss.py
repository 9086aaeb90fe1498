"""Fit the coefficients of the chance of loss to recorded sessions with ground truth.

python -m tools.make_loss SESSION... [--seeds N] [--jobs N] [--inverse-penalty C]

Each session is a folder with ``bag/`` and ``ground_truth.json``. It is tracked with the preset
``default`` once for each seed, each time in another way (``tools/tracked_ways.py``). The state
``lost`` is switched off, because it would leave out wrong results.

A logistic regression on the evidence of each frame
(``cardbox_tracker/estimation/filtering/loss.py``) estimates the chance that the keypoints are wrong
by more than 30 cm on average; wrong and right frames weigh alike. The tool prints the coefficients
beside those of the package, and the quality of both on sessions outside the training data.
scikit-learn is needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import log_loss, roc_auc_score
from sklearn.utils.class_weight import compute_sample_weight

from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering import loss
from cardbox_tracker.estimation.filtering.loss import COEFFICIENTS, INTERCEPT, Evidence
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.figures import FAR_CM
from cardbox_tracker.evaluation.recorded.session import load_session
from tools import logistic
from tools.logistic import chances
from tools.tracked_ways import track

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHIPPED = np.array([INTERCEPT, *COEFFICIENTS.values()])
"""The package's intercept and coefficients."""

INVERSE_PENALTY = 1e-3
"""Weight of the data against the penalty on coefficients; larger ones need many sessions."""


class Frames(NamedTuple):
    """Frames of a session: features (n, F) in the order of ``COEFFICIENTS``, and whether wrong."""

    features: FloatArray
    is_wrong: BoolArray


def frames_of(folder: Path, seed: int) -> Frames:
    """Track a session in the way of the seed; see :class:`Frames`.

    Raises:
        CardboxError: the folder is no session, or cannot be read.
    """
    session, preset = load_session(folder), PRESETS["default"]()
    config = replace(preset, lost_iou=0.0, whole_body=replace(preset.whole_body, lost_from=1.0))
    truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    features: list[list[float]] = []
    is_wrong: list[bool] = []
    latest: list[Evidence] = []
    chance_of_loss = loss.chance_of_loss

    def noted(evidence: Evidence) -> float:
        latest[:] = [evidence]
        return chance_of_loss(evidence)

    def keep(_: int, stamp_ns: int, estimate: Estimate, __: Tracker) -> None:
        if estimate.keypoints_m is None or stamp_ns not in truth:
            return
        off_m = np.linalg.norm(estimate.keypoints_m - truth[stamp_ns], axis=1)
        if np.isfinite(off_m).all():
            features.append(list(loss.features_of_loss(latest[0]).values()))
            is_wrong.append(bool(100.0 * off_m.mean() > FAR_CM))

    with patch.object(loss, "chance_of_loss", noted):
        track(session, config, seed, keep)
    return Frames(np.array(features).reshape(-1, len(COEFFICIENTS)), np.array(is_wrong, bool))


def fitted(frames: Frames, inverse_penalty: float = INVERSE_PENALTY) -> FloatArray:
    """Return intercept and coefficients (1 + F,) of the logistic regression.

    Raises:
        ValueError: all frames are right, or all wrong.
    """
    return logistic.fitted(*frames, np.ones(len(frames.is_wrong)), inverse_penalty)


def left_out_chances(sessions: Sequence[Frames], inverse_penalty: float) -> FloatArray:
    """Return the chances of all frames, each by coefficients fitted to the other sessions."""
    found = []
    for number, one in enumerate(sessions):
        others = together([*sessions[:number], *sessions[number + 1 :]])
        found.append(chances(fitted(others, inverse_penalty), one.features))
    return np.concatenate(found)


def together(sessions: Iterable[Frames]) -> Frames:
    """Return the frames of all sessions."""
    return Frames(*(np.concatenate(arrays) for arrays in zip(*sessions, strict=True)))


def quality(found: FloatArray, is_wrong: BoolArray) -> tuple[float, float]:
    """Return log loss, wrong and right frames weighing alike, and the area under the ROC curve."""
    weights = compute_sample_weight("balanced", is_wrong)
    return (
        float(log_loss(is_wrong, found, sample_weight=weights)),
        float(roc_auc_score(is_wrong, found)),
    )


def report(sessions: Sequence[Frames], inverse_penalty: float = INVERSE_PENALTY) -> str:
    """Return the coefficients beside the shipped ones, and the quality of both.

    Raises:
        ValueError: without one of the sessions, all frames are right.
    """
    every = together(sessions)
    found = fitted(every, inverse_penalty)
    lines = [f"{'':16} {'fitted':>8} {'shipped':>8}"]
    for name, *values in zip(("intercept", *COEFFICIENTS), found, SHIPPED, strict=True):
        lines.append(f"{name:16} {values[0]:8.3f} {values[1]:8.3f}")
    share = 100.0 * every.is_wrong.mean()
    lines += [
        "",
        f"{len(every.is_wrong)} frames of {len(sessions)} sessions, {share:.1f} % wrong",
        f"{'':16} {'log loss':>8} {'AUC':>8}",
    ]
    rows = [("shipped", chances(SHIPPED, every.features))]
    if len(sessions) > 1:
        rows.insert(0, ("fitted, left out", left_out_chances(sessions, inverse_penalty)))
    for name, said in rows:
        lines.append("{:16} {:8.3f} {:8.3f}".format(name, *quality(said, every.is_wrong)))
    return "\n".join(lines)


def main(args: list[str] | None = None) -> int:
    """Track, fit and print; the package's coefficients stay as they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=1, help="runs of each session")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument(
        "--inverse-penalty",
        type=float,
        default=INVERSE_PENALTY,
        metavar="C",
        help="larger for many sessions (default: %(default)s)",
    )
    given = parser.parse_args(args)
    with ProcessPoolExecutor(given.jobs) as pool:
        runs = [
            list(pool.map(partial(frames_of, seed=seed), given.sessions))
            for seed in range(given.seeds)
        ]
    sessions = [together(of_session) for of_session in zip(*runs, strict=True)]
    for folder, one in zip(given.sessions, sessions, strict=True):
        print(f"{folder.name}: {one.is_wrong.sum()} of {len(one.is_wrong)} frames wrong")
    try:
        print(report(sessions, given.inverse_penalty))
    except ValueError as error:
        print(f"no fit: {error}; give more sessions, with wrong frames", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
