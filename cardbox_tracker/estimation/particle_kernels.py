"""What a filter does to all its particles in every cycle, compiled."""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

import numpy as np
from numba import njit

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def propagate(steps: Any, particles: Any, ancestors: Any, sigma: Any, limits: Any) -> None:
    """Turn ``steps`` (N, D) of unit noise into new particles, in place.

    A new particle is its ancestor's place in ``particles`` (N, D) plus ``sigma`` (D,) times its
    noise, kept within ``limits`` (D, 2). ``ancestors`` is (N,).
    """
    for i in range(steps.shape[0]):
        ancestor = ancestors[i]
        for d in range(steps.shape[1]):
            moved = particles[ancestor, d] + steps[i, d] * sigma[d]
            steps[i, d] = min(max(moved, limits[d, 0]), limits[d, 1])


@_compile
def weighted_stddev(particles: Any, costs: Any, mean: Any, spread: float) -> Any:
    """Standard deviation (D,) around ``mean`` (D,) of particles (N, D) with ``costs`` (N,).

    They are weighted by exp(-(W - W_best) / spread).
    """
    best = costs.min()
    total = 0.0
    squares = np.zeros(particles.shape[1])
    for i in range(particles.shape[0]):
        weight = exp((best - costs[i]) / spread)
        total += weight
        for d in range(particles.shape[1]):
            squares[d] += weight * (particles[i, d] - mean[d]) ** 2
    for d in range(particles.shape[1]):
        squares[d] = sqrt(squares[d] / total)
    return squares
