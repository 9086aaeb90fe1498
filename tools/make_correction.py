"""Learn the correction of the tracker's results from recorded sessions with ground truth.

python -m tools.make_correction SESSION... --check SESSION... --output FILE [--jobs N]
                                [--go-on FILE]

Each session is a folder with ``bag/`` and ``ground_truth.json``. It is tracked with the preset
``default`` once for each seed, each time in another way (``tools/tracked_ways.py``). The network
learns the offsets of the true keypoints from those found
(``cardbox_tracker/estimation/filtering/correction.py``), and steady output.

The sessions after ``--check`` are no training data. The tool prints their absolute and aligned
error, cm, and the error of the acceleration, m/s^2, without the correction and with it.
``--go-on`` begins with the networks of a file that this tool has written, such as that of the
package, and trains at a lower rate. The package's network for several cameras is the one for one
camera, trained further on recordings of several. PyTorch is needed: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.correction import NetworkCorrector, moved
from cardbox_tracker.estimation.filtering.depth_features import DEPTH_FEATURES
from cardbox_tracker.estimation.filtering.low_pass import LowPass
from cardbox_tracker.estimation.filtering.networks import (
    Layer,
    RecurrentNetwork,
    read_recurrent_network,
    scaled_features,
)
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.metrics import acceleration_error, beside_shoulders
from cardbox_tracker.evaluation.recorded.session import load_session
from tools import networks
from tools.tracked_ways import track

FloatArray = NDArray[np.float64]

# Rough standard deviations of the answers, m: shoulders' middle, elbow, hand; x, y, z of each.
UNIT_M = np.repeat([0.05, 0.05, 0.10], 3)
# Numbers of nodes: the first layer, the hidden state, the last layer but one.
INPUTS, NODES, LEFT = 192, 160, 96
NETWORKS, EPOCHS = 2, 12
# Images of a sequence (the next one begins half a sequence later), and sequences of a batch.
LENGTH, BATCH = 120, 16
RATE, DECAY = 3e-3, 1e-3
# The same for --go-on, and the share of the way to the new weights that is kept.
RATE_ON, EPOCHS_ON, KEPT_ON = 2e-3, 14, 0.7
# The training includes the low-pass filter, so the network learns to compensate its delay.
SMOOTHING_S = WholeBodyConfig().output_smoothing_s
# Standard deviation of the noise on the features of a sequence, as in tools/networks.py.
NOISE, NOISE_ON = 0.1, 0.25
# Weight of the acceleration error, m per m/s^2, and the shortest period it is computed with, s.
STEADY, LEAST_PERIOD_S = 0.01, 0.05
# A bone shorter than this has no reliable direction, m.
LEAST_BONE_M = 0.01
# Larger errors are clipped, as no correction mends a wrong posture; m and m/s^2.
MOST_M, MOST_M_S2 = 2.0, 60.0

# Columns that most images lack, and the floor of their scale, m.
OF_DEPTH = slice(-DEPTH_FEATURES, None), 0.08


class Samples(NamedTuple):
    """Images of a session, one after the other.

    Attributes:
        features: inputs of the network, (n, 2, F).
        found_m: keypoints without the correction, (n, 6, 3), metres in the optical frame.
        true_m: true ones, nan where they are not scored.
        stamps_ns: (n,).
    """

    features: FloatArray
    found_m: FloatArray
    true_m: FloatArray
    stamps_ns: NDArray[np.int64]


def samples_of(folder: Path, seed: int) -> Samples:
    """Track a session; see :class:`Samples`."""
    session = load_session(folder)
    wanted = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    unknown = np.full((6, 3), np.nan)
    rows: list[tuple[FloatArray, FloatArray, FloatArray, int]] = []

    def keep(_: int, stamp_ns: int, __: Estimate, tracker: Tracker) -> None:
        assert isinstance(tracker.filter, WholeBodyFilter)
        refine = tracker.filter.refine
        assert isinstance(refine.corrector, NetworkCorrector)
        features = refine.corrector.features
        # Features of a lost person count; without a person they stay the same array.
        if refine.found is None or (rows and rows[-1][0] is features):
            return
        true_m = wanted.get(stamp_ns, unknown)
        rows.append((features, refine.found.keypoints_m, true_m, stamp_ns))

    track(session, PRESETS["default"](), seed, keep)
    if len(rows) < LENGTH:
        raise SystemExit(f"{folder}: nobody was tracked for long; leave the session out")
    features, found_m, true_m, stamps_ns = (np.array(c) for c in zip(*rows, strict=True))
    return Samples(features, found_m, true_m, stamps_ns)


def learn(
    samples: Sequence[Samples], seed: int = 0, begin: RecurrentNetwork | None = None
) -> RecurrentNetwork:
    """Train a network on these sessions, beginning with the weights of ``begin`` if given."""
    if begin is None:
        mean, scale = networks.mean_and_scale(networks.by_arm(samples), [OF_DEPTH])
    else:
        mean, scale = begin.mean, begin.scale
    sequences = _sequences(samples, mean, scale)
    layers = [
        _layers(_learned(sequences, seed + number, begin, number)) for number in range(NETWORKS)
    ]
    input_layer, gru_input, gru_hidden, first, last = (
        (np.stack([one[i][0] for one in layers]), np.stack([one[i][1] for one in layers]))
        for i in range(5)
    )
    network = RecurrentNetwork(
        mean, scale, networks.MOST, input_layer, gru_input, gru_hidden, (first, last), UNIT_M
    )
    return network if begin is None else _between(begin, network)


def _between(begin: RecurrentNetwork, end: RecurrentNetwork) -> RecurrentNetwork:
    """Interpolate the weights, ``KEPT_ON`` of the way from ``begin`` to ``end``.

    The result keeps more of the old data than ``end`` (Wortsman et al., "Robust Fine-Tuning of
    Zero-Shot Models", 2022).
    """

    def mixed(one: Layer, other: Layer) -> Layer:
        weights, biases = ((1 - KEPT_ON) * a + KEPT_ON * b for a, b in zip(one, other, strict=True))
        return weights, biases

    first, last = (
        mixed(*pair) for pair in zip(begin.output_layers, end.output_layers, strict=True)
    )
    return end._replace(
        input_layer=mixed(begin.input_layer, end.input_layer),
        gru_input=mixed(begin.gru_input, end.gru_input),
        gru_hidden=mixed(begin.gru_hidden, end.gru_hidden),
        output_layers=(first, last),
    )


def _sequences(samples: Sequence[Samples], mean: FloatArray, scale: FloatArray) -> list[Any]:
    """Return tensors of sequences: features, found, true, whether the truth is known, period."""
    import torch

    parts: list[tuple[object, ...]] = []
    for one in samples:
        scaled = scaled_features(one.features, mean, scale, networks.MOST)
        period_s = max(float(np.median(np.diff(one.stamps_ns))) / 1e9, LEAST_PERIOD_S)
        known = np.asarray(np.isfinite(one.true_m).all(axis=(1, 2)), np.float64)
        starts = [*range(0, len(scaled) - LENGTH, LENGTH // 2), len(scaled) - LENGTH]
        for start in starts:
            of = slice(start, start + LENGTH)
            true_m = np.nan_to_num(one.true_m[of])
            parts.append((scaled[of], one.found_m[of], true_m, known[of], period_s))
    return [torch.tensor(np.array(c), dtype=torch.float32) for c in zip(*parts, strict=True)]


def _learned(sequences: list[Any], seed: int, begin: RecurrentNetwork | None, number: int) -> Any:
    """Train the modules (input_layer, recurrent, first, last) on the sequences.

    They begin with the weights of network ``number`` of ``begin``, if that is given.
    """
    import torch
    from torch import nn

    torch.manual_seed(seed)
    features, found, true, known, period = sequences
    modules = nn.ModuleList(
        [
            nn.Linear(features.shape[3], INPUTS),
            nn.GRU(INPUTS, NODES, batch_first=True),
            nn.Linear(NODES + INPUTS, LEFT),
            nn.Linear(LEFT, len(UNIT_M)),
        ]
    )
    settings = (RATE, EPOCHS, NOISE) if begin is None else (RATE_ON, EPOCHS_ON, NOISE_ON)
    rate, epochs, deviation = settings
    if begin is not None:
        _put(begin, number, modules)
    batches = len(features) // BATCH
    optimizer = torch.optim.AdamW(modules.parameters(), lr=rate, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, rate, total_steps=epochs * batches + 1
    )
    for _ in range(epochs):
        for chosen in torch.randperm(len(features))[: batches * BATCH].split(BATCH):
            noise = deviation * torch.randn(len(chosen), 1, 2, features.shape[3])
            answers = _answers(modules, features[chosen] + noise)
            off = _steadied(_moved(found[chosen], answers), period[chosen]) - true[chosen]
            loss = _loss(off, known[chosen], period[chosen])
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(modules.parameters(), 1.0)
            optimizer.step()
            schedule.step()
    return modules


def _answers(modules: Any, features: Any) -> Any:
    """Return the answers (B, L, 2, 9), metres, to features (B, L, 2, F)."""
    import torch

    input_layer, recurrent, first, last = modules
    inputs = torch.relu(input_layer(features))
    batch, length = features.shape[:2]
    # Each arm is a sequence of its own.
    arms = inputs.permute(0, 2, 1, 3).reshape(2 * batch, length, -1)
    hidden = recurrent(arms)[0]
    scaled = last(torch.relu(first(torch.cat([hidden, arms], dim=2))))
    scaled = scaled.reshape(batch, 2, length, -1).permute(0, 2, 1, 3)
    return scaled * torch.tensor(UNIT_M, dtype=torch.float32)


def _moved(found: Any, answers: Any) -> Any:
    """Do what :func:`moved` does, for tensors of sequences."""
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


def _steadied(points: Any, period_s: Any) -> Any:
    """Return the low-pass filtered keypoints (B, L, 6, 3) of images a period apart."""
    import torch

    if SMOOTHING_S == 0.0:
        return points
    age = torch.arange(points.shape[1])
    age = age[:, None] - age[None, :]
    kept = torch.exp(-period_s / SMOOTHING_S)[:, None, None]
    shares = torch.where(age >= 0, (1.0 - kept) * kept ** age.clamp(min=0), 0.0)
    # The filter starts with the first value.
    shares[:, :, 0] = kept[:, 0] ** age[:, 0]
    return torch.einsum("bts,bskc->btkc", shares, points)


def _direction(vectors: Any) -> Any:
    return vectors / (vectors.square().sum(dim=-1, keepdim=True) + LEAST_BONE_M**2).sqrt()


def _loss(off: Any, known: Any, period_s: Any) -> Any:
    """Return the sum of absolute error, aligned error and weighted acceleration error, metres."""
    aligned = off - 0.5 * (off[:, :, :1] + off[:, :, 3:4])
    each = (_length(off, 1e-2) + _length(aligned, 1e-2)).clamp(max=MOST_M)
    second = (off[:, :-2] - 2.0 * off[:, 1:-1] + off[:, 2:]) / period_s[:, None, None, None] ** 2
    shaken = _length(second, 0.1).clamp(max=MOST_M_S2)
    three = known[:, :-2] * known[:, 1:-1] * known[:, 2:]
    error = (each * known).sum() / known.sum()
    return error + STEADY * (shaken * three).sum() / three.sum()


def _length(vectors: Any, least: float) -> Any:
    """Return the mean length of the keypoints' vectors (B, L, 6, 3), smooth at 0."""
    return (vectors.square().sum(dim=-1) + least**2).sqrt().mean(dim=-1)


def _layers(modules: Any) -> list[tuple[FloatArray, FloatArray]]:
    """Return weights and biases of the five layers as :class:`RecurrentNetwork` has them."""
    input_layer, gru, first, last = modules
    pairs = [
        (input_layer.weight, input_layer.bias),
        (gru.weight_ih_l0, gru.bias_ih_l0),
        (gru.weight_hh_l0, gru.bias_hh_l0),
        (first.weight, first.bias),
        (last.weight, last.bias),
    ]
    # PyTorch has the same order of gates: reset, update, candidate.
    return [networks.numbers_of(*pair) for pair in pairs]


def _put(network: RecurrentNetwork, number: int, modules: Any) -> None:
    """Write the weights of one network into modules: the inverse of :func:`_layers`."""
    import torch

    input_layer, gru, first, last = modules
    pairs = [
        (network.input_layer, input_layer.weight, input_layer.bias),
        (network.gru_input, gru.weight_ih_l0, gru.bias_ih_l0),
        (network.gru_hidden, gru.weight_hh_l0, gru.bias_hh_l0),
        (network.output_layers[0], first.weight, first.bias),
        (network.output_layers[1], last.weight, last.bias),
    ]
    with torch.no_grad():
        for (weights, biases), weight, bias in pairs:
            weight.copy_(torch.tensor(weights[number].T))
            bias.copy_(torch.tensor(biases[number, 0]))


def corrected(network: RecurrentNetwork, samples: Samples) -> FloatArray:
    """Return the corrected and low-pass filtered keypoints, (n, 6, 3)."""
    hidden, low_pass = network.initial_hidden(2), LowPass(SMOOTHING_S)
    intervals_s = np.diff(samples.stamps_ns, prepend=samples.stamps_ns[:1]) / 1e9
    result = np.empty_like(samples.found_m)
    for i, (features, found_m) in enumerate(zip(samples.features, samples.found_m, strict=True)):
        answers_m, hidden = network(features, hidden)
        result[i] = low_pass(moved(found_m, answers_m), float(intervals_s[i]))
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
    """Track, train, check, write."""
    return networks.run(args, __doc__, samples_of, learn, check, read=read_recurrent_network)


if __name__ == "__main__":
    sys.exit(main())
