"""Train the small networks of the package and write them.

This needs PyTorch: ``pip install '.[learn]'``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.filtering.networks import (
    Network,
    RecurrentNetwork,
    scaled_features,
)
from cardbox_tracker.estimation.filtering.result_features import OF_CAMERAS
from cardbox_tracker.files import atomic_path

FloatArray = NDArray[np.float64]

# Scaled features are clipped at this distance from the mean.
MOST = 2.5
# Standard deviation of the noise on the features; it makes neighbours have similar answers.
NOISE = 0.4
_LEAST_SCALE = 1e-3
# The features of further cameras are constant in most recordings, so their scale has a floor.
_SCALE_OF_CAMERAS = 0.4
RATE, DECAY, BATCH = 1e-3, 1e-3, 256


class Images(Protocol):
    """The images of a recording."""

    @property
    def features(self) -> FloatArray:
        """Inputs of the networks, (n, 2, F)."""


@dataclass(frozen=True)
class Shape:
    """Size and training time of the networks.

    Attributes:
        layers: nodes of the hidden layers.
        networks: number of networks that are averaged.
        epochs: passes over the data; many of them overfit.
    """

    layers: tuple[int, ...]
    networks: int
    epochs: int


def by_arm(sessions: Sequence[Images]) -> FloatArray:
    """Return the features of all images, the left arm's before the right one's, (2 n, F)."""
    return np.concatenate([one.features.reshape(-1, one.features.shape[2]) for one in sessions])


def mean_and_scale(
    features: FloatArray, seldom: Sequence[tuple[slice, float]] = ()
) -> tuple[FloatArray, FloatArray]:
    """Return mean and scale, the standard deviation with a floor, of features (n, F).

    Args:
        features: of all images.
        seldom: columns that most images lack, beside those of cameras, each with the floor of its
            scale; without it, the values in the other images would all be clipped at ``MOST``.
    """
    least = np.full(features.shape[1], _LEAST_SCALE)
    for some, scale in ((OF_CAMERAS, _SCALE_OF_CAMERAS), *seldom):
        least[some] = scale
    return features.mean(axis=0), np.maximum(features.std(axis=0), least)


def learn(
    sessions: Sequence[Images],
    answers: FloatArray,
    unit: FloatArray,
    shape: Shape,
    seed: int = 0,
) -> Network:
    """Train the network that gives the answers (2 n, A) to the n images of the sessions.

    Args:
        sessions: one after the other.
        answers: of the left arm, then of the right one, of each image, (2 n, A).
        unit: divisor of the answers, (A,), about their standard deviations.
        shape: of the network.
        seed: of the noise and of the first weights.
    """
    features = by_arm(sessions)
    mean, scale = mean_and_scale(features)
    scaled = scaled_features(features, mean, scale, MOST)
    layers = [_learned(scaled, answers / unit, shape, seed + i) for i in range(shape.networks)]
    weights, biases = zip(*(zip(*one, strict=True) for one in layers), strict=True)
    return Network(
        mean,
        scale,
        MOST,
        tuple(np.stack(of_layer).astype(np.float64) for of_layer in zip(*weights, strict=True)),
        tuple(np.stack(of_layer).astype(np.float64) for of_layer in zip(*biases, strict=True)),
        unit,
    )


def _learned(
    features: FloatArray, answers: FloatArray, shape: Shape, seed: int
) -> list[tuple[FloatArray, FloatArray]]:
    """Return weights (inputs, outputs) and biases (1, outputs) of each layer of one network."""
    import torch
    from torch import nn

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    nodes = (features.shape[1], *shape.layers, answers.shape[1])
    linear = [nn.Linear(*pair) for pair in pairwise(nodes)]
    between = [part for layer in linear for part in (layer, nn.ReLU())][:-1]
    network = nn.Sequential(*between)
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    known, wanted = (torch.tensor(a, dtype=torch.float32) for a in (features, answers))
    for _ in range(shape.epochs):
        for chosen in torch.randperm(len(known)).split(BATCH):
            noisy = known[chosen] + NOISE * torch.randn(len(chosen), known.shape[1])
            loss = (network(noisy) - wanted[chosen]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    return [numbers_of(layer.weight, layer.bias) for layer in linear]


def numbers_of(weight: Any, bias: Any) -> tuple[FloatArray, FloatArray]:
    """Return weights (inputs, outputs) and biases (1, outputs) of a layer of PyTorch."""
    return weight.detach().numpy().T, bias.detach().numpy()[None]


def save(network: Network | RecurrentNetwork, path: Path, about: str) -> None:
    """Write a network to a file that ``cardbox_tracker.estimation.filtering.networks`` reads."""
    if isinstance(network, Network):
        layers = list(zip(network.weights, network.biases, strict=True))
    else:
        layers = [
            *(network.input_layer, network.gru_input, network.gru_hidden),
            *network.output_layers,
        ]
    arrays = {
        "about": np.array(about),
        "mean": network.mean,
        "scale": network.scale,
        "most": np.array(network.most),
        "unit": network.unit,
    }
    for i, (weights, biases) in enumerate(layers):
        arrays[f"weights{i}"], arrays[f"biases{i}"] = weights, biases
    packed = {
        name: array.astype(np.float32) if array.dtype.kind == "f" else array
        for name, array in arrays.items()
    }
    with atomic_path(path) as temporary:
        np.savez_compressed(temporary, allow_pickle=False, **packed)
