"""Small neural networks that were learned from recordings, and the data files they are in."""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray


class Network(NamedTuple):
    """Some networks of the same shape, whose answers are averaged.

    Attributes:
        mean: of the features, (F,).
        scale: their deviations, (F,).
        most: scaled features beyond this count as this.
        weights: of each layer, (networks, inputs, outputs).
        biases: of each layer, (networks, 1, outputs).
        unit: of the answers, (A,).
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    unit: FloatArray

    def __call__(self, features: FloatArray) -> FloatArray:
        """Return the answers, (n, A), to features (n, F)."""
        scaled = np.clip((features - self.mean) / self.scale, -self.most, self.most)
        values = np.broadcast_to(scaled, (len(self.weights[0]), *scaled.shape))
        for number, (weights, biases) in enumerate(zip(self.weights, self.biases, strict=True)):
            if number > 0:
                values = np.maximum(values, 0.0)
            values = values @ weights + biases
        answer: FloatArray = values.mean(axis=0) * self.unit
        return answer


@cache
def load_network(name: str) -> Network:
    """Return the network of the package in the data file ``name``."""
    with resources.as_file(resources.files(__package__).joinpath(name)) as path:
        return read_network(path)


def read_network(path: Path) -> Network:
    """Return the network in a file that ``tools/networks.py`` has written."""
    with np.load(path) as stored:
        names = [name for name in stored.files if name != "about"]
        data = {name: np.asarray(stored[name], np.float64) for name in names}
    layers = sum(name.startswith("weights") for name in names)
    return Network(
        data["mean"],
        data["scale"],
        float(data["most"]),
        tuple(data[f"weights{i}"] for i in range(layers)),
        tuple(data[f"biases{i}"] for i in range(layers)),
        data["unit"],
    )
