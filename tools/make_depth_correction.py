"""Learn the correction of depth from recorded sessions with ground truth.

python -m tools.make_depth_correction SESSION... --check SESSION... --output FILE [--jobs N]

Each session is a folder with ``bag/`` and ``ground_truth.json``. It is initialized and tracked
with the preset ``default`` without the correction; the network learns what its results lack in
depth (``cardbox_tracker/estimation/filtering/depth_correction.py``). Those after ``--check`` are
not learned from: absolute and aligned error without the correction and with it are printed for
them, cm. Needs scikit-learn: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.depth_correction import missing_depth, moved_in_depth
from cardbox_tracker.estimation.filtering.networks import Network
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.metrics import beside_shoulders
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.evaluation.recorded.tracking import track_session
from tools import networks

FloatArray = NDArray[np.float64]

# What the answers are divided by, m: about their deviations.
UNIT_M = np.array([0.06, 0.05, 0.12])
SHARE = PRESETS["default"]().whole_body.depth_correction
# An error beyond this is another posture, which no correction mends, m.
MOST_M = 0.4
SHAPE = networks.Shape(layers=(256, 64), networks=4, epochs=16)


class Samples(NamedTuple):
    """Images of a session: features (n, 2, F), keypoints found and true, (n, 6, 3), metres."""

    features: FloatArray
    found_m: FloatArray
    true_m: FloatArray


def samples_of(folder: Path, seed: int) -> Samples:
    """Track a session; see :class:`Samples`."""
    session, preset = load_session(folder), PRESETS["default"]()
    config = replace(preset, whole_body=replace(preset.whole_body, depth_correction=0.0))
    wanted = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    pitch_rad = float(np.radians(session.truth.pitch_deg))
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = []

    def keep(_: int, stamp_ns: int, estimate: Estimate, __: Tracker) -> None:
        true_m = wanted.get(stamp_ns)
        if true_m is None or estimate.posture is None or not np.isfinite(true_m).all():
            return
        features = networks.features_of_estimate(estimate, pitch_rad)
        rows.append((features, np.asarray(estimate.keypoints_m), true_m))

    track_session(session, config, (seed,), observe=keep)
    if not rows:
        raise SystemExit(f"{folder}: nobody was tracked; leave the session out")
    return Samples(*(np.array(column) for column in zip(*rows, strict=True)))


def learn(samples: Sequence[Samples], seed: int = 0) -> Network:
    """Return the network that learned from these sessions."""
    answers = [missing_depth(one.found_m, one.true_m).reshape(-1, 3) for one in samples]
    missing_m = np.clip(np.concatenate(answers), -MOST_M, MOST_M)
    return networks.learn(samples, missing_m, UNIT_M, SHAPE, seed)


def errors_cm(found_m: FloatArray, true_m: FloatArray) -> tuple[float, float]:
    """Return the mean error of keypoints (n, 6, 3), and without that of the shoulders' middle."""
    off = 100.0 * (found_m - true_m)
    each = off, beside_shoulders(off)
    mean, without = (float(np.linalg.norm(one, axis=2).mean()) for one in each)
    return mean, without


def check(
    network: Network, samples: Samples, share: float = SHARE
) -> tuple[float, float, float, float]:
    """Return :func:`errors_cm` without and with a share of the correction."""
    features = samples.features
    missing_m = share * network(features.reshape(-1, features.shape[2])).reshape(-1, 2, 3)
    corrected_m = moved_in_depth(samples.found_m, missing_m)
    before = errors_cm(samples.found_m, samples.true_m)
    return *before, *errors_cm(corrected_m, samples.true_m)


def main(args: list[str] | None = None) -> int:
    """Track, learn, check, write."""
    return networks.run(args, __doc__, samples_of, learn, check)


if __name__ == "__main__":
    sys.exit(main())
