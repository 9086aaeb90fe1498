"""Learn the standard deviations of the angles from recorded sessions with ground truth.

python -m tools.make_deviations SESSION... --fresh SESSION... --check SESSION... --output FILE

Each session is a folder with ``bag/`` and ``ground_truth.json``. It is tracked with the preset
``default`` once for each seed, each time in another way (``tools/tracked_ways.py``). The network
learns the logarithm of the error of each angle
(``cardbox_tracker/estimation/filtering/deviations.py``), so train the correction first
(``tools/make_correction.py``).

The correction has smaller errors on its training data. So a factor for each angle comes from the
sessions after ``--fresh``, which must not be among them. For the sessions after ``--check`` the
tool prints in how many images an error is within two deviations, %, mean and least over the
angles, with the particles' deviations and with the learned ones. PyTorch is needed:
``pip install '.[learn]'``.
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
from cardbox_tracker.estimation.filtering.correction import NetworkCorrector
from cardbox_tracker.estimation.filtering.deviations import TORSO, deviations_of
from cardbox_tracker.estimation.filtering.networks import Network
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.metrics import angle_errors_deg
from cardbox_tracker.evaluation.recorded.angles import true_postures
from cardbox_tracker.evaluation.recorded.session import load_session
from tools import networks
from tools.tracked_ways import track

FloatArray = NDArray[np.float64]

SHAPE = networks.Shape(layers=(48, 24), networks=4, epochs=30)
# Added to an error before its logarithm is taken, rad, which bounds the logarithm.
LEAST_RAD = 0.02
# Share of the errors within two deviations.
HELD = 0.95


class Errors(NamedTuple):
    """Images of a session: features (n, 2, F), errors and particles' deviations (n, 11), rad."""

    features: FloatArray
    errors_rad: FloatArray
    stddevs_rad: FloatArray


def errors_of(folder: Path, seed: int) -> Errors:
    """Track a session; see :class:`Errors`."""
    session, preset = load_session(folder), PRESETS["default"]()
    config = replace(preset, whole_body=replace(preset.whole_body, learned_deviations=False))
    known = np.isfinite(session.torso_rad).all(axis=1)
    known &= np.isfinite(session.keypoints_m).all(axis=(1, 2))
    stamps_ns = session.stamps_ns[known].tolist()
    wanted = dict(zip(stamps_ns, true_postures(session)[known], strict=True))
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = []

    def keep(_: int, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> None:
        truth = wanted.get(stamp_ns)
        if truth is None or estimate.posture is None:
            return
        assert isinstance(tracker.filter, WholeBodyFilter)
        error_rad = np.radians(angle_errors_deg(estimate.posture[1:], truth[1:]))
        stddev = np.asarray(estimate.posture_stddev)[1:]
        corrector = tracker.filter.refine.corrector
        assert isinstance(corrector, NetworkCorrector)
        rows.append((corrector.result_features, error_rad, stddev))

    track(session, config, seed, keep)
    if not rows:
        raise SystemExit(f"{folder}: nobody was tracked; leave the session out")
    return Errors(*(np.array(column) for column in zip(*rows, strict=True)))


def learn(samples: Sequence[Errors], seed: int = 0) -> Network:
    """Train a network on the logarithms of the errors of these sessions."""
    errors = np.concatenate([_beside_arms(one.errors_rad) for one in samples])
    unit = np.ones(errors.shape[1])
    return networks.learn(samples, np.log(errors + LEAST_RAD), unit, SHAPE, seed)


def scaled(network: Network, samples: Sequence[Errors]) -> Network:
    """Scale each angle's deviations so that two of them hold ``HELD`` of the errors."""
    errors = np.concatenate([_beside_arms(one.errors_rad) for one in samples])
    ratios = errors / np.exp(network(networks.by_arm(samples)))
    factors = np.quantile(ratios, HELD, axis=0) / 2.0
    *biases, last = network.biases
    return network._replace(biases=(*biases, last + np.log(factors)))


def _beside_arms(angles: FloatArray) -> FloatArray:
    """Return angles (n, 11) in the layout of the answers: torso and one arm, (2 n, 7)."""
    middle = TORSO + (angles.shape[1] - TORSO) // 2
    torso, left, right = np.split(angles, (TORSO, middle), axis=1)
    arms = np.hstack([torso, left]), np.hstack([torso, right])
    return np.stack(arms, axis=1).reshape(-1, middle)


def check(network: Network, errors: Errors) -> tuple[float, float, float, float]:
    """Return mean and least share of errors within two deviations, before and after, %."""
    shares: list[float] = []
    for stddevs in (errors.stddevs_rad, deviations_of(network, errors.features)):
        within = 100.0 * (errors.errors_rad <= 2.0 * stddevs).mean(axis=0)
        shares += [float(within.mean()), float(within.min())]
    return shares[0], shares[1], shares[2], shares[3]


def main(args: list[str] | None = None) -> int:
    """Track, train, check, write."""
    return networks.run(args, __doc__, errors_of, learn, check, scaled)


if __name__ == "__main__":
    sys.exit(main())
