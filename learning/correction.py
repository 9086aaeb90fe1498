"""Train the network that corrects the tracker's results.

python -m learning.correction SAMPLES... --output FILE [--check SAMPLES...] [--leave-out SOURCE]

SAMPLES are folders that ``learning.simulate`` has written, or, for ``--check``,
``learning.sessions``. The network learns the offsets of the true keypoints from those found
(``cardbox_tracker/estimation/filtering/correction.py``), steady output, and the log-odds that a
corrected keypoint is off by more than ``FAR_M``. One of ten recordings is not trained with; these
calibrate the log-odds (``learning/odds.py``). With ``--leave-out``,
such as ``family=rocketbox`` or ``source=cmu``, this source is not trained with; it is checked. The
check prints absolute and aligned error, cm, and the error of the acceleration, m/s^2, without the
correction and with it. PyTorch is needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.correction import (
    DISPLACEMENTS,
    DOUBT,
    FAR_M,
    LOG_ODDS,
    N_ANSWERS,
    OF_DEPTH,
    OF_POINTS,
)
from cardbox_tracker.estimation.filtering.low_pass import LowPass, kept_share
from cardbox_tracker.estimation.filtering.networks import (
    RecurrentNetwork,
    scaled_features,
)
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.evaluation.metrics import acceleration_error, beside_shoulders
from learning import networks
from learning.answers import answers_of
from learning.command_line import run, training_arguments
from learning.odds import calibrated
from learning.samples import Samples, grouped, load_all, split

FloatArray = NDArray[np.float64]
Layer = tuple[FloatArray, FloatArray]

# Rough standard deviations of the displacements, m: shoulders' middle, elbow, hand; x, y, z of
# each. Log-odds have none.
UNIT = np.ones(N_ANSWERS)
UNIT[DISPLACEMENTS] = np.repeat([0.05, 0.05, 0.10], 3)
# Numbers of nodes: the first layer, the hidden state, and the last layer but one of displacements
# and of log-odds.
INPUTS, NODES, LEFT, OF_ODDS = 160, 128, 96, 48
NETWORKS, EPOCHS = 3, 9
# Images of a sequence, and sequences of a batch.
LENGTH, BATCH = 120, 32
RATE, DECAY = 3e-3, 1e-3
# The training includes the low-pass filter, so the network learns to compensate its delay.
SMOOTHING_S = WholeBodyConfig().output_smoothing_s
# Standard deviation of the constant noise on the features of a sequence.
NOISE = 0.15
# Weight of the acceleration error, m per m/s^2.
STEADY = 0.01
# Weight of errors that the correction makes larger.
HARM = 1.5
# Displacements are not trained with recordings of a larger median error: no correction mends a
# lost person, m.
LOST_M = 0.35
# One of this number of recordings calibrates the log-odds.
CALIBRATING = 10
# A bone shorter than this has no reliable direction, m.
LEAST_BONE_M = 0.01
# Larger errors are clipped, as no correction mends a wrong posture; m and m/s^2.
MOST_M, MOST_M_S2 = 2.0, 60.0

# Columns that most images lack, and the floor of their scale, m.
_SELDOM = (OF_DEPTH, 0.08), (OF_POINTS, 0.1)


def learn(
    samples: Sequence[Samples],
    seed: int = 0,
    epochs: int = EPOCHS,
    jobs: int = 1,
    count: int | None = None,
) -> RecurrentNetwork:
    """Train ``count`` networks, or ``NETWORKS``; ``jobs`` of them at a time.

    With 100 recordings or more, one of ten is not trained with and calibrates the log-odds.

    Raises:
        CardboxError: the recordings are fewer or shorter than a batch.
    """
    calibrating: list[Samples] = []
    if len(samples) >= CALIBRATING**2:
        calibrating = list(samples[::CALIBRATING])
        samples = [one for number, one in enumerate(samples) if number % CALIBRATING]
    lengths = [len(one.features) for one in samples]
    given = sum(-(-length // LENGTH) for length in lengths if length >= LENGTH)
    if given < BATCH:
        raise CardboxError(
            f"the samples have {given} sequences of {LENGTH} images; give {BATCH} or more"
        )
    followed = [one for one in samples if _median_m(one) < LOST_M]
    mean, scale = networks.mean_and_scale(networks.by_arm(followed or samples), _SELDOM)
    sequences = _sequences(samples, mean, scale)
    seeds = range(seed, seed + (count or NETWORKS))
    with ProcessPoolExecutor(jobs) as pool:
        layers = list(pool.map(partial(_learned, sequences, epochs=epochs), seeds))
    input_layer, gru_input, gru_hidden, first, last = (
        (np.stack([one[i][0] for one in layers]), np.stack([one[i][1] for one in layers]))
        for i in range(5)
    )
    network = RecurrentNetwork(
        mean, scale, networks.MOST, input_layer, gru_input, gru_hidden, (first, last), UNIT
    )
    return calibrated(network, calibrating) if calibrating else network


def _median_m(samples: Samples) -> float:
    """Return the median error of the keypoints that were found."""
    return float(np.nanmedian(np.linalg.norm(samples.found_m - samples.true_m, axis=2)))


def _sequences(
    samples: Sequence[Samples], mean: FloatArray, scale: FloatArray
) -> list[NDArray[np.float32]]:
    """Return sequences: features, found, true, truth known, person followed, period."""
    parts: list[tuple[object, ...]] = []
    for one in samples:
        if len(one.features) < LENGTH:
            continue
        scaled = scaled_features(one.features, mean, scale, networks.MOST)
        period_s = float(np.median(np.diff(one.stamps_ns))) / 1e9
        known = np.asarray(np.isfinite(one.true_m).all(axis=(1, 2)), np.float64)
        followed = known * (_median_m(one) < LOST_M)
        starts = [*range(0, len(scaled) - LENGTH, LENGTH), len(scaled) - LENGTH]
        for start in starts:
            of = slice(start, start + LENGTH)
            true_m = np.nan_to_num(one.true_m[of])
            parts.append((scaled[of], one.found_m[of], true_m, known[of], followed[of], period_s))
    return [np.array(column, np.float32) for column in zip(*parts, strict=True)]


def _learned(
    sequences: list[NDArray[np.float32]], seed: int, epochs: int
) -> list[tuple[FloatArray, FloatArray]]:
    """Train the modules and return the layers of a :class:`RecurrentNetwork`."""
    import torch
    from torch import nn

    # Several threads slow each other down where other programs run, too.
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    features, found, true, known, followed, period = map(torch.from_numpy, sequences)
    modules = nn.ModuleList(
        [
            nn.Linear(features.shape[3], INPUTS),
            nn.GRU(INPUTS, NODES, batch_first=True),
            nn.Linear(NODES + INPUTS, LEFT),
            nn.Linear(LEFT, LOG_ODDS.start),
            nn.Linear(NODES + INPUTS, OF_ODDS),
            nn.Linear(OF_ODDS, N_ANSWERS - LOG_ODDS.start),
        ]
    )
    batches = len(features) // BATCH
    optimizer = torch.optim.AdamW(modules.parameters(), lr=RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, RATE, total_steps=epochs * batches + 1
    )
    for _ in range(epochs):
        for chosen in torch.randperm(len(features))[: batches * BATCH].split(BATCH):
            noise = NOISE * torch.randn(len(chosen), 1, 2, features.shape[3])
            answers, log_odds = _answers(modules, features[chosen] + noise)
            shares = _shares(period[chosen], LENGTH)
            off, before = (
                _steadied(points, shares) - true[chosen]
                for points in (_moved(found[chosen], answers), found[chosen])
            )
            loss = _loss(off, before, followed[chosen], period[chosen])
            loss = loss + _log_loss(log_odds, off, known[chosen])
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(modules.parameters(), 1.0)
            optimizer.step()
            schedule.step()
    return _layers(modules)


def _answers(modules: Any, features: Any) -> tuple[Any, Any]:
    """Return displacements (B, L, 2, 9), m, and log-odds (B, L, 2, 3) for features (B, L, 2, F)."""
    import torch

    input_layer, recurrent, first, last, first_of_odds, last_of_odds = modules
    inputs = torch.relu(input_layer(features))
    batch, length = features.shape[:2]
    # Each arm is a sequence of its own.
    arms = inputs.permute(0, 2, 1, 3).reshape(2 * batch, length, -1)
    hidden = recurrent(arms)[0]
    both = torch.cat([hidden, arms], dim=2)
    scaled = last(torch.relu(first(both)))
    # Log-odds must not change what the displacements are made from.
    log_odds = last_of_odds(torch.relu(first_of_odds(both.detach())))
    displacements, log_odds = (
        one.reshape(batch, 2, length, -1).permute(0, 2, 1, 3) for one in (scaled, log_odds)
    )
    return displacements * torch.tensor(UNIT[DISPLACEMENTS], dtype=torch.float32), log_odds


def _moved(found: Any, answers: Any) -> Any:
    """Do what the package's ``correction.moved`` does, for tensors of sequences."""
    import torch

    arms = answers.reshape(*answers.shape[:3], 3, 3)
    left, right = arms[:, :, 0], arms[:, :, 1] * torch.tensor([-1.0, 1.0, 1.0])
    middle = 0.5 * (left[:, :, :1] + right[:, :, :1])
    parts = []
    for arm, said in enumerate((left, right)):
        joints = found[:, :, 3 * arm : 3 * arm + 3]
        lengths = (joints[:, :, 1:] - joints[:, :, :-1]).norm(dim=-1, keepdim=True)
        shoulder = joints[:, :, :1] + middle
        elbow, hand = (joints[:, :, i : i + 1] + middle + said[:, :, i : i + 1] for i in (1, 2))
        elbow = shoulder + lengths[:, :, :1] * _direction(elbow - shoulder)
        hand = elbow + lengths[:, :, 1:] * _direction(hand - elbow)
        parts += [shoulder, elbow, hand]
    return torch.cat(parts, dim=2)


def _shares(period_s: Any, length: int) -> Any:
    """Return the shares (B, L, L) of the images in each low-pass filtered image."""
    import torch

    kept = torch.tensor([kept_share(float(one), SMOOTHING_S) for one in period_s])
    kept = kept[:, None, None]
    age = torch.arange(length)
    age = age[:, None] - age[None, :]
    shares = torch.where(age >= 0, (1.0 - kept) * kept ** age.clamp(min=0), 0.0)
    # The filter starts with the first value.
    shares[:, :, 0] = kept[:, 0] ** age[:, 0]
    return shares


def _steadied(points: Any, shares: Any) -> Any:
    """Return the low-pass filtered keypoints (B, L, 6, 3)."""
    import torch

    return torch.einsum("bts,bskc->btkc", shares, points)


def _direction(vectors: Any) -> Any:
    return vectors / (vectors.square().sum(dim=-1, keepdim=True) + LEAST_BONE_M**2).sqrt()


def _loss(off: Any, before: Any, known: Any, period_s: Any) -> Any:
    """Return the sum of absolute, aligned and weighted acceleration error and harm, metres."""
    import torch

    each = sum(
        _length(after, 1e-2) + HARM * torch.relu(_length(after, 1e-2) - _length(first, 1e-2))
        for after, first in ((off, before), (_aligned(off), _aligned(before)))
    ).clamp(max=MOST_M)
    second = (off[:, :-2] - 2.0 * off[:, 1:-1] + off[:, 2:]) / period_s[:, None, None, None] ** 2
    shaken = _length(second, 0.1).clamp(max=MOST_M_S2)
    three = (known[:, :-2] * known[:, 1:-1] * known[:, 2:])[..., None].expand_as(shaken)
    error = (each * known[..., None]).sum() / (6.0 * known.sum()).clamp(min=1.0)
    return error + STEADY * (shaken * three).sum() / three.sum().clamp(min=1.0)


def _log_loss(log_odds: Any, off: Any, known: Any) -> Any:
    """Return the mean log loss of log-odds (B, L, 2, 3) that keypoints are off by over FAR_M."""
    from torch.nn.functional import binary_cross_entropy_with_logits

    is_far = (off.detach().norm(dim=-1) > FAR_M).reshape(log_odds.shape).to(log_odds.dtype)
    each = binary_cross_entropy_with_logits(log_odds, is_far, reduction="none")
    return (each * known[..., None, None]).sum() / (6.0 * known.sum()).clamp(min=1.0)


def _aligned(off: Any) -> Any:
    return off - 0.5 * (off[:, :, :1] + off[:, :, 3:4])


def _length(vectors: Any, least: float) -> Any:
    """Return the lengths of the keypoints' vectors (B, L, 6), smooth at 0."""
    return (vectors.square().sum(dim=-1) + least**2).sqrt()


def _layers(modules: Any) -> list[tuple[FloatArray, FloatArray]]:
    """Return weights and biases of the five layers as :class:`RecurrentNetwork` has them."""
    input_layer, gru, *output_layers = modules
    pairs = [
        (input_layer.weight, input_layer.bias),
        (gru.weight_ih_l0, gru.bias_ih_l0),
        (gru.weight_hh_l0, gru.bias_hh_l0),
        *((layer.weight, layer.bias) for layer in output_layers),
    ]
    # PyTorch has the same order of gates: reset, update, candidate.
    *common, first, last, first_of_odds, last_of_odds = (
        networks.numbers_of(*pair) for pair in pairs
    )
    return [*common, _beside(first, first_of_odds), _apart(last, last_of_odds)]


def _beside(one: Layer, other: Layer) -> Layer:
    """Return the layer that has the outputs of two layers with the same inputs."""
    return np.hstack([one[0], other[0]]), np.hstack([one[1], other[1]])


def _apart(one: Layer, other: Layer) -> Layer:
    """Return the layer that has inputs and outputs of two layers, without connections between."""
    upper = np.hstack([one[0], np.zeros((len(one[0]), other[0].shape[1]))])
    lower = np.hstack([np.zeros((len(other[0]), one[0].shape[1])), other[0]])
    return np.vstack([upper, lower]), np.hstack([one[1], other[1]])


def corrected(network: RecurrentNetwork, samples: Samples, doubt: float = DOUBT) -> FloatArray:
    """Return the corrected and low-pass filtered keypoints, (n, 6, 3)."""
    low_pass = LowPass(SMOOTHING_S)
    intervals_s = np.diff(samples.stamps_ns, prepend=samples.stamps_ns[:1]) / 1e9
    result = np.empty_like(samples.found_m)
    for i, (corrected_m, _) in enumerate(answers_of(network, samples, doubt)):
        result[i] = low_pass(corrected_m, float(intervals_s[i]))
    return result


def errors(found_m: FloatArray, samples: Samples) -> tuple[float, float, float]:
    """Return absolute and aligned error, cm, and that of the acceleration, m/s^2."""
    off_m = found_m - samples.true_m
    each = off_m, beside_shoulders(off_m)
    mean, aligned = (100.0 * float(np.nanmean(np.linalg.norm(one, axis=2))) for one in each)
    return mean, aligned, acceleration_error(off_m, samples.stamps_ns)


def check(network: RecurrentNetwork, samples: Samples) -> tuple[float, ...]:
    """Return :func:`errors` without and with the correction."""
    return *errors(samples.found_m, samples), *errors(corrected(network, samples), samples)


def main(args: list[str] | None = None) -> int:
    """Train, check, write."""
    parser = training_arguments(__doc__)
    parser.add_argument("--epochs", type=int, default=EPOCHS)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    samples, others = load_all(given.samples), load_all(given.check)
    if given.leave_out:
        samples, left_out = split(samples, given.leave_out)
        others = left_out + others
    network = learn(samples, given.seed, given.epochs, given.jobs)
    images = sum(len(one.features) for one in samples)
    networks.save(network, given.output, f"{images} images of {len(samples)} recordings")
    print(f"written: {given.output}")
    for name, group in grouped(others).items():
        figures = np.mean([check(network, one) for one in group], axis=0)
        print(name, *(f"{value:.1f}" for value in figures))
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
