"""Train the network that estimates the standard deviations of the angles.

python -m learning.deviations SAMPLES... --output FILE [--leave-out SOURCE] [--check SAMPLES...]

SAMPLES are folders that ``learning.simulate --corrected`` has written, because the deviations are
those of corrected results; train the correction first (``learning/correction.py``). The network
learns the logarithm of the error of each angle
(``cardbox_tracker/estimation/filtering/deviations.py``).

The correction has smaller errors on recordings that it was trained with, so samples must be of
others. One of four is not trained with; these give a factor for each angle. The source after
``--leave-out`` is not used. For it, and for the samples after ``--check``, the tool prints in
how many images an error is within two deviations, %, mean and least over the angles, with the
particles' deviations and with the learned ones. PyTorch is needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.posture import POSTURE
from cardbox_tracker.estimation.filtering.deviations import TORSO, deviations_of
from cardbox_tracker.estimation.filtering.networks import Network
from cardbox_tracker.evaluation.metrics import angle_errors_deg
from cardbox_tracker.evaluation.recorded.angles import joint_angles
from learning import networks
from learning.command_line import run, training_arguments
from learning.samples import Samples, grouped, load_all, split

FloatArray = NDArray[np.float64]

SHAPE = networks.Shape(layers=(48, 24), networks=4, epochs=20)
# Added to an error before its logarithm is taken, rad, which bounds the logarithm.
LEAST_RAD = 0.02
# Share of the errors within two deviations.
HELD = 0.95
# One of this number of recordings scales the deviations.
SCALING = 4


class Errors(NamedTuple):
    """Images of a recording: features (n, 2, F), errors and particles' deviations (n, 11), rad."""

    features: FloatArray
    errors_rad: FloatArray
    stddevs_rad: FloatArray


def errors_of(samples: Samples) -> Errors:
    """Return the errors in the images whose truth is known."""
    known = np.isfinite(samples.torso_rad).all(axis=1)
    known &= np.isfinite(samples.true_m).all(axis=(1, 2))
    truth = joint_angles(samples.true_m[known], samples.torso_rad[known], float(samples.pitch_rad))
    found = samples.states[known][:, POSTURE]
    return Errors(
        np.asarray(samples.result_features[known], np.float64),
        np.radians(angle_errors_deg(found[:, 1:], truth)),
        np.asarray(samples.stddevs[known][:, POSTURE][:, 1:], np.float64),
    )


def learn(samples: Sequence[Errors], seed: int = 0) -> Network:
    """Train a network on the logarithms of the errors of these recordings."""
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
    """Train, scale, check, write."""
    parser = training_arguments(__doc__)
    given = parser.parse_args(args)
    samples, others = load_all(given.samples), load_all(given.check)
    if given.leave_out:
        samples, left_out = split(samples, given.leave_out)
        others = left_out + others
    errors = [errors_of(one) for one in samples]
    trained = [one for number, one in enumerate(errors) if number % SCALING]
    network = scaled(learn(trained, given.seed), errors[::SCALING])
    images = sum(len(one.features) for one in samples)
    networks.save(network, given.output, f"{images} images of {len(samples)} recordings")
    print(f"written: {given.output}")
    for name, group in grouped(others).items():
        print(name, *(f"{value:.1f}" for value in check(network, _errors_together(group))))
    return 0


def _errors_together(samples: Sequence[Samples]) -> Errors:
    each = [errors_of(one) for one in samples]
    return Errors(*(np.concatenate(column) for column in zip(*each, strict=True)))


if __name__ == "__main__":
    sys.exit(run(main))
