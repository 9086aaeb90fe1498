"""Learn the small networks of the package, and write them.

Needs scikit-learn: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.networks import Network
from cardbox_tracker.estimation.filtering.result_features import features_of
from cardbox_tracker.files import atomic_path

FloatArray = NDArray[np.float64]

# Scaled features farther from the mean than this count as this.
MOST = 2.5
# Deviation of the noise that each copy of a sample gets: neighbours shall have similar answers.
NOISE, COPIES = 0.4, 3
PENALTY, RATE, BATCH = 1.0, 1e-3, 256


class Images(Protocol):
    """What the tools keep of the images of a session."""

    @property
    def features(self) -> FloatArray:
        """What the networks see, (n, 2, F)."""


OfSession = TypeVar("OfSession", bound=Images)


@dataclass(frozen=True)
class Shape:
    """How large the networks are, and how long they learn.

    Attributes:
        layers: nodes of the hidden layers.
        networks: how many are averaged.
        epochs: a few are meant: more of them learn the sessions by heart.
    """

    layers: tuple[int, ...]
    networks: int
    epochs: int


def features_of_estimate(estimate: Estimate, pitch_rad: float) -> FloatArray:
    """Return what the networks see of an estimate with a posture, (2, F)."""
    parts = estimate.posture, estimate.offset_m, estimate.posture_stddev, estimate.offset_stddev_m
    posture, offset, stddev, offset_stddev = (np.asarray(part) for part in parts)
    features: FloatArray = features_of(
        np.concatenate([posture, offset])[None],
        np.concatenate([stddev, offset_stddev])[None],
        np.asarray(estimate.keypoints_m)[None],
        np.array([estimate.iou or 0.0]),
        pitch_rad,
    )[0]
    return features


def learn(
    sessions: Sequence[Images],
    answers: FloatArray,
    unit: FloatArray,
    shape: Shape,
    seed: int = 0,
) -> Network:
    """Return the network that gives the answers (2 n, A) to the n images of the sessions.

    Args:
        sessions: one after the other.
        answers: of the left arm, then of the right one, of each image, (2 n, A).
        unit: what the answers are divided by, (A,): about their deviations.
        shape: of the network.
        seed: of the noise and of the first weights.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    warnings.simplefilter("ignore", ConvergenceWarning)
    features = np.concatenate([one.features.reshape(-1, one.features.shape[2]) for one in sessions])
    mean, scale = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-3)
    scaled = np.clip((features - mean) / scale, -MOST, MOST)
    rng = np.random.default_rng(seed)
    noisy = [scaled + NOISE * rng.standard_normal(scaled.shape) for _ in range(COPIES)]
    networks = [
        MLPRegressor(
            hidden_layer_sizes=shape.layers,
            alpha=PENALTY,
            learning_rate_init=RATE,
            max_iter=shape.epochs,
            batch_size=BATCH,
            random_state=seed + number,
        ).fit(np.concatenate(noisy), np.concatenate([answers / unit] * COPIES))
        for number in range(shape.networks)
    ]
    layers = range(len(shape.layers) + 1)
    return Network(
        mean,
        scale,
        MOST,
        tuple(np.stack([one.coefs_[i] for one in networks]) for i in layers),
        tuple(np.stack([one.intercepts_[i][None] for one in networks]) for i in layers),
        unit,
    )


def save(network: Network, path: Path, about: str) -> None:
    """Write a network as :func:`~.networks.read_network` reads it."""
    arrays = {
        "about": np.array(about),
        "mean": network.mean,
        "scale": network.scale,
        "most": np.array(network.most),
        "unit": network.unit,
    }
    for i, (weights, biases) in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays[f"weights{i}"], arrays[f"biases{i}"] = weights, biases
    packed = {
        name: array.astype(np.float32) if array.dtype.kind == "f" else array
        for name, array in arrays.items()
    }
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **packed)


def run(
    args: Sequence[str] | None,
    description: str | None,
    track: Callable[..., OfSession],
    learn_from: Callable[[Sequence[OfSession], int], Network],
    check: Callable[[Network, OfSession], Sequence[float]],
) -> int:
    """Run one of the tools: track all sessions, learn from some, check the others, write.

    Args:
        args: of the command line; None: those of the process.
        description: of the tool.
        track: returns what is kept of a session's folder, with ``seed``; it runs in processes of
            their own.
        learn_from: returns the network, with a seed.
        check: returns the figures of a session that was not learned from.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--check", nargs="*", type=Path, default=[], metavar="SESSION")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--about", default="", help="where the sessions come from; is kept with it")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    with ProcessPoolExecutor(given.jobs) as pool:
        folders = [*given.sessions, *given.check]
        sessions = list(pool.map(partial(track, seed=given.seed), folders))
    learned, others = sessions[: len(given.sessions)], sessions[len(given.sessions) :]
    network = learn_from(learned, given.seed)
    rows = [check(network, one) for one in others]
    for folder, row in zip(given.check, rows, strict=True):
        print(folder.name, *(f"{value:.1f}" for value in row))
    if rows:
        print("mean", *(f"{value:.2f}" for value in np.mean(rows, axis=0)))
    images = sum(len(one.features) for one in learned)
    about = f"{given.about} {images} images of {len(learned)} sessions".strip()
    save(network, given.output, about)
    print(f"written: {given.output}")
    return 0
