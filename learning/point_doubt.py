"""Fit the coefficients of the doubt about a detector's points to sessions with ground truth.

python -m learning.point_doubt SESSION... [--most N] [--jobs N] [--inverse-penalty C]

Each session is a folder with ``bag/`` and ``ground_truth.json``. Its first camera tracks with the
preset ``default`` and the points of the installed detector (``cardbox detector --install``). The
body has the mean proportions of people of that stature, also where the session could measure the
person; stature, distance and pitch are the true ones. The state ``lost`` is switched off, because
it would leave out wrong results.

A logistic regression on ``point_doubt.FEATURES`` estimates the chance that a joint is wrong by more
than 20 cm. Each source weighs alike (the films of one repository are one source, and so are the
rendered sessions), and so do wrong and right images. The tool prints the coefficients beside those
of the package; for each source the area under the ROC curve of coefficients fitted to the others;
and by threshold how many images are certain, and how many of these are wrong. scikit-learn is
needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score

from cardbox_tracker.body.proportions import STATURE_M, body_from_proportions
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.filtering import point_doubt
from cardbox_tracker.estimation.tracker import Tracker
from learning import logistic
from learning.logistic import chances
from tools.detected_sessions import first_camera_of, motions, opened, source_of, source_weights

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SHIPPED = np.array([point_doubt.INTERCEPT, *point_doubt.COEFFICIENTS])
"""The package's intercept and coefficients."""

FAR_M = 0.2
"""Error of a joint from which on a result is wrong."""

THRESHOLDS = (0.15, 0.2, 0.25, 0.3, 0.35)
"""Chances above which a result could be called uncertain."""

INVERSE_PENALTY = 1.0
"""Weight of the data against the penalty on coefficients."""


class Frames(NamedTuple):
    """Frames of a session: its source, features (n, 4), and whether wrong, (n,)."""

    source: str
    features: FloatArray
    is_wrong: BoolArray


class Fit(NamedTuple):
    """All frames, (n, ...): features, whether wrong, and weights by source."""

    features: FloatArray
    is_wrong: BoolArray
    weights: FloatArray


def frames_of(folder: Path, most: int | None = None) -> Frames:
    """Track the first ``most`` images of a session; see :class:`Frames`.

    Raises:
        CardboxError: the folder is no session, cannot be read, or the detector is not installed.
    """
    session, preset = first_camera_of(folder), PRESETS["default"]()
    search = replace(preset.whole_body, lost_from=1.0, uncertain_from=1.0)
    config = replace(preset, lost_iou=0.0, whole_body=search)
    truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    given = session.truth
    body = body_from_proportions(
        given.stature_m or STATURE_M,
        given.distance_m,
        camera_pitch_rad=float(np.radians(given.pitch_deg)),
    )
    features: list[FloatArray] = []
    is_wrong: list[bool] = []
    latest: list[FloatArray] = []

    def noted(found: FloatArray) -> float:
        latest[:] = [found]
        return 0.0

    # Without the limit of the distance, the chance is asked for in every image with points.
    patched = patch.multiple(point_doubt, FAR_M=np.inf, chance_of_error=noted)
    with opened(session) as source, patched:
        tracker = Tracker(body, source.first.camera, config, np.random.default_rng(0))
        for taken in motions(session, source, most):
            latest.clear()
            found = tracker.track(taken.observations).keypoints_m
            true = truth.get(taken.stamp_ns)
            if found is None or true is None or not latest:
                continue
            off_m = np.linalg.norm(found - true, axis=1)
            if np.isfinite(off_m).all():
                features.append(latest[0])
                is_wrong.append(bool(off_m.max() > FAR_M))
    width = len(point_doubt.FEATURES)
    return Frames(
        source_of(session), np.array(features).reshape(-1, width), np.array(is_wrong, bool)
    )


def together(sessions: Sequence[Frames]) -> Fit:
    """Return the frames of all sessions, and weights with the same sum for each source."""
    counts = [len(one.is_wrong) for one in sessions]
    return Fit(
        np.concatenate([one.features for one in sessions]),
        np.concatenate([one.is_wrong for one in sessions]),
        source_weights([one.source for one in sessions], counts),
    )


def fitted(frames: Fit, inverse_penalty: float = INVERSE_PENALTY) -> FloatArray:
    """Return intercept and coefficients (5,) of the logistic regression.

    Raises:
        ValueError: all frames are right, or all wrong.
    """
    return logistic.fitted(*frames, inverse_penalty)


def kept(frames: Fit, found: FloatArray, threshold: float) -> tuple[float, float]:
    """Return the share of certain frames, and that of wrong ones among these, each source alike.

    Args:
        frames: the frames.
        found: their chances, (n,).
        threshold: chance above which a frame is uncertain.
    """
    distances_m = frames.features[:, point_doubt.FEATURES.index("distance_to_point_m")]
    is_kept = (found <= threshold) & (distances_m <= point_doubt.FAR_M)
    weight = float(frames.weights[is_kept].sum())
    wrong = float(frames.weights[is_kept & frames.is_wrong].sum())
    return weight / float(frames.weights.sum()), wrong / weight if weight else float("nan")


def report(sessions: Sequence[Frames], inverse_penalty: float = INVERSE_PENALTY) -> str:
    """Return coefficients, figures of each source, and shares by threshold.

    Raises:
        ValueError: all frames are right, or all wrong.
    """
    every = together(sessions)
    own = fitted(every, inverse_penalty)
    lines = [f"{'':20} {'fitted':>8} {'shipped':>8}"]
    for name, *pair in zip(("intercept", *point_doubt.FEATURES), own, SHIPPED, strict=True):
        lines.append(f"{name:20} {pair[0]:8.2f} {pair[1]:8.2f}")
    limit = point_doubt.UNCERTAIN_FROM
    heads = "left out", "AUC", "wrong, %", "kept, %", "wrong, %"
    lines += ["", f"{'':20} {'AUC':>8} {'shipped:':>8} {'':8} certain up to {limit}"]
    lines.append(" ".join([f"{'':20}", *(f"{head:>8}" for head in heads)]))
    for source in sorted({one.source for one in sessions}):
        of_source = together([one for one in sessions if one.source == source])
        others = [one for one in sessions if one.source != source]
        lines.append(f"{source[-20:]:20} {_figures(of_source, others, inverse_penalty)}")
    lines += ["", f"{'certain up to':20} {'kept, %':>8} {'wrong, %':>8}   shipped: the same"]
    pairs = [chances(own, every.features), chances(SHIPPED, every.features)]
    for threshold in THRESHOLDS:
        shares = [100.0 * share for found in pairs for share in kept(every, found, threshold)]
        lines.append("{:<20} {:8.1f} {:8.1f} {:8.1f} {:8.1f}".format(threshold, *shares))
    return "\n".join(lines)


def _figures(frames: Fit, others: Sequence[Frames], inverse_penalty: float) -> str:
    """Return AUC of coefficients fitted to other sources, and figures of the shipped ones."""
    areas = float("nan"), _area(SHIPPED, frames)
    if others and _has_both(together(others)):
        areas = _area(fitted(together(others), inverse_penalty), frames), areas[1]
    shares = kept(frames, chances(SHIPPED, frames.features), point_doubt.UNCERTAIN_FROM)
    percent = [100.0 * share for share in (float(frames.is_wrong.mean()), *shares)]
    return "{:8.3f} {:8.3f} {:8.1f} {:8.1f} {:8.1f}".format(*areas, *percent)


def _has_both(frames: Fit) -> bool:
    """Return whether there are wrong frames, and right ones."""
    return bool(frames.is_wrong.any() and not frames.is_wrong.all())


def _area(coefficients: FloatArray, frames: Fit) -> float:
    """Return the area under the ROC curve; nan if all frames are right, or all wrong."""
    if not _has_both(frames):
        return float("nan")
    return float(roc_auc_score(frames.is_wrong, chances(coefficients, frames.features)))


def main(args: list[str] | None = None) -> int:
    """Track, fit and print; the package's coefficients stay as they are."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument(
        "--most", type=int, metavar="N", help="images of each session; all if unset"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument(
        "--inverse-penalty",
        type=float,
        default=INVERSE_PENALTY,
        metavar="C",
        help="weight of the data (default: %(default)s)",
    )
    given = parser.parse_args(args)
    try:
        with ProcessPoolExecutor(given.jobs) as pool:
            sessions = list(pool.map(partial(frames_of, most=given.most), given.sessions))
        for folder, one in zip(given.sessions, sessions, strict=True):
            print(f"{folder.name}: {one.is_wrong.sum()} of {len(one.is_wrong)} images wrong")
        print(report(sessions, given.inverse_penalty))
    except CardboxError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except ValueError as error:
        print(f"no fit: {error}; give sessions with right and wrong images", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
