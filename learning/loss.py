"""Fit the coefficients of the chance of loss.

python -m learning.loss SAMPLES... [--inverse-penalty C]

SAMPLES are folders that ``learning.simulate --corrected`` or ``learning.sessions --corrected`` has
written; in them no result is called lost, because that would leave out wrong results.

A logistic regression on the evidence of each frame
(``cardbox_tracker/estimation/filtering/loss.py``) estimates the chance that the keypoints are wrong
by more than 30 cm on average; wrong and right frames weigh alike. The tool prints the coefficients
beside those of the package, and the quality of both on sources outside the training data.
scikit-learn is needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import log_loss, roc_auc_score
from sklearn.utils.class_weight import compute_sample_weight

from cardbox_tracker.estimation.filtering.loss import COEFFICIENTS, INTERCEPT
from cardbox_tracker.evaluation.recorded.figures import FAR_CM
from learning import logistic
from learning.command_line import run
from learning.logistic import chances
from learning.samples import Samples, grouped, load_all

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHIPPED = np.array([INTERCEPT, *COEFFICIENTS.values()])
"""The package's intercept and coefficients."""

INVERSE_PENALTY = 1e-3
"""Weight of the data against the penalty on coefficients; larger ones need many sessions."""


class Frames(NamedTuple):
    """Frames of a source: features (n, F) in the order of ``COEFFICIENTS``, and whether wrong."""

    features: FloatArray
    is_wrong: BoolArray


def frames_of(samples: Samples) -> Frames:
    """Return the frames whose truth is known; the results are the corrected ones."""
    known = np.isfinite(samples.true_m).all(axis=(1, 2))
    off_m = np.linalg.norm(samples.result_m - samples.true_m, axis=2).mean(axis=1)
    is_wrong = 100.0 * off_m[known] > FAR_CM
    return Frames(np.asarray(samples.evidence[known], np.float64), is_wrong)


def fitted(frames: Frames, inverse_penalty: float = INVERSE_PENALTY) -> FloatArray:
    """Return intercept and coefficients (1 + F,) of the logistic regression.

    Raises:
        ValueError: all frames are right, or all wrong.
    """
    return logistic.fitted(*frames, np.ones(len(frames.is_wrong)), inverse_penalty)


def left_out_chances(sessions: Sequence[Frames], inverse_penalty: float) -> FloatArray:
    """Return the chances of all frames, each by coefficients fitted to the other sources."""
    found = []
    for number, one in enumerate(sessions):
        others = together([*sessions[:number], *sessions[number + 1 :]])
        found.append(chances(fitted(others, inverse_penalty), one.features))
    return np.concatenate(found)


def together(sessions: Iterable[Frames]) -> Frames:
    """Return the frames of all sources."""
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
        f"{len(every.is_wrong)} frames of {len(sessions)} sources, {share:.1f} % wrong",
        f"{'':16} {'log loss':>8} {'AUC':>8}",
    ]
    rows = [("shipped", chances(SHIPPED, every.features))]
    if len(sessions) > 1:
        rows.insert(0, ("fitted, left out", left_out_chances(sessions, inverse_penalty)))
    for name, said in rows:
        lines.append("{:16} {:8.3f} {:8.3f}".format(name, *quality(said, every.is_wrong)))
    return "\n".join(lines)


def main(args: list[str] | None = None) -> int:
    """Fit and print; the package's coefficients stay as they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="+", type=Path)
    parser.add_argument(
        "--inverse-penalty",
        type=float,
        default=INVERSE_PENALTY,
        metavar="C",
        help="larger for many sources (default: %(default)s)",
    )
    given = parser.parse_args(args)
    sources = {
        name: together(frames_of(one) for one in group)
        for name, group in grouped(load_all(given.samples)).items()
    }
    for name, one in sources.items():
        print(f"{name}: {one.is_wrong.sum()} of {len(one.is_wrong)} frames wrong")
    try:
        print(report(list(sources.values()), given.inverse_penalty))
    except ValueError as error:
        print(f"no fit: {error}; give more samples, with wrong frames", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
