"""Learn the small networks of the package, and write them.

Needs scikit-learn: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.filtering.networks import Network
from cardbox_tracker.files import atomic_path

FloatArray = NDArray[np.float64]

# Scaled features farther from the mean than this count as this.
MOST = 2.5
# Deviation of the noise that each copy of a sample gets: neighbours shall have similar answers.
NOISE, COPIES = 0.4, 3
PENALTY, RATE, BATCH = 1.0, 1e-3, 256


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


def learn(
    features: FloatArray, answers: FloatArray, unit: FloatArray, shape: Shape, seed: int = 0
) -> Network:
    """Return the network that gives the answers (n, A) to the features (n, F).

    Args:
        features: (n, F).
        answers: (n, A).
        unit: what the answers are divided by, (A,): about their deviations.
        shape: of the network.
        seed: of the noise and of the first weights.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPRegressor

    warnings.simplefilter("ignore", ConvergenceWarning)
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
