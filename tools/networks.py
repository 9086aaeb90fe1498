"""Train the small networks of the package and write them.

This needs PyTorch: ``pip install '.[learn]'``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol, TypeVar

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
    """The images of a session, as the tools keep them."""

    @property
    def features(self) -> FloatArray:
        """Inputs of the networks, (n, 2, F)."""


OfSession = TypeVar("OfSession", bound=Images)
AnyNetwork = TypeVar("AnyNetwork", Network, RecurrentNetwork)


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


def show(folders: Sequence[Path], rows: Sequence[Sequence[float]]) -> None:
    """Print the figures of sessions, and their means."""
    for folder, row in zip(folders, rows, strict=True):
        print(folder.name, *(f"{value:.1f}" for value in row))
    print("mean", *(f"{value:.2f}" for value in np.mean(rows, axis=0)))


def run(
    args: Sequence[str] | None,
    description: str | None,
    track: Callable[..., OfSession],
    learn_from: Callable[..., AnyNetwork],
    check: Callable[[AnyNetwork, OfSession], Sequence[float]],
    adjust: Callable[[AnyNetwork, Sequence[OfSession]], AnyNetwork] | None = None,
    read: Callable[[Path], AnyNetwork] | None = None,
) -> int:
    """Run one of the tools: track all sessions, train on some, check the others, write.

    Args:
        args: of the command line; None: those of the process.
        description: of the tool.
        track: takes a session's folder and ``seed`` and returns its images; it runs in worker
            processes.
        learn_from: takes sessions, the seed of the training and, with ``read``, the network to
            begin with; returns the trained network.
        check: returns the figures of a session outside the training data.
        adjust: takes the trained network and the sessions after ``--fresh``; returns the network
            to write.
        read: reads the file after ``--go-on``.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--check", nargs="*", type=Path, default=[], metavar="SESSION")
    if adjust is not None:
        parser.add_argument("--fresh", nargs="+", type=Path, required=True, metavar="SESSION")
    if read is not None:
        parser.add_argument("--go-on", type=Path, metavar="FILE", help="networks to begin with")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--about", default="", help="origin of the sessions, stored in the file")
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--seeds", type=int, default=1, help="runs of each session")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    with ProcessPoolExecutor(given.jobs) as pool:
        learned: list[OfSession] = []
        for seed in range(given.seeds):
            learned += pool.map(partial(track, seed=seed), given.sessions)
        fresh = list(pool.map(partial(track, seed=0), given.fresh)) if adjust else []
        others = list(pool.map(partial(track, seed=0), given.check))
    begin = [read(given.go_on)] if read is not None and given.go_on is not None else []
    network = learn_from(learned, given.seed, *begin)
    if adjust is not None:
        network = adjust(network, fresh)
    if others:
        show(given.check, [check(network, one) for one in others])
    images = sum(len(one.features) for one in learned)
    what = f"{images} images of {len(given.sessions)} sessions, {given.seeds} seeds"
    about = f"{given.about} {what}".strip()
    save(network, given.output, about)
    print(f"written: {given.output}")
    return 0
