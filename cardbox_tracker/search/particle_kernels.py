"""Compiled steps of one iteration over all particles of a filter."""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import kernel


@kernel
def propagate(steps: Any, particles: Any, ancestors: Any, sigma: Any) -> None:
    """Turn ``steps`` (N, D) of unit noise into new particles, in place.

    A new particle is that of its index in ``ancestors`` (N,) plus ``sigma`` (D,) times its noise.
    """
    for i in range(steps.shape[0]):
        ancestor = ancestors[i]
        for d in range(steps.shape[1]):
            steps[i, d] = particles[ancestor, d] + steps[i, d] * sigma[d]


@kernel
def clip(particles: Any, limits: Any) -> None:
    """Clip every joint of ``particles`` (N, D) to its ``limits`` (D, 2), in place."""
    for i in range(particles.shape[0]):
        for d in range(particles.shape[1]):
            particles[i, d] = min(max(particles[i, d], limits[d, 0]), limits[d, 1])


@kernel
def weighted_stddev(particles: Any, costs: Any, mean: Any, spread: float) -> Any:
    """Return the deviation (D,) around ``mean``, by weights exp(-(W - W_best) / spread)."""
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


@kernel
def _cheapest(costs: Any, count: int) -> Any:
    """Return the indices (``count``,) of the lowest ``costs`` (N,); the first of equal costs."""
    limit = np.partition(costs, count - 1)[count - 1]
    ties = count
    for cost in costs:
        if cost < limit:
            ties -= 1
    chosen = np.zeros(count, np.intp)
    place = 0
    for i in range(costs.shape[0]):
        if costs[i] < limit or (costs[i] == limit and ties > 0):
            if costs[i] == limit:
                ties -= 1
            chosen[place] = i
            place += 1
    return chosen


@kernel
def truncate(costs: Any, count: int) -> Any:
    """Return ancestors (N,): the best particle, the other survivors, then copies of the best.

    The ``count`` particles with the lowest ``costs`` (N,) survive; of equal costs the first ones.
    """
    best = np.argmin(costs)
    ancestors = np.full(costs.shape[0], best)
    place = 1
    for i in _cheapest(costs, count):
        if i != best:
            ancestors[place] = i
            place += 1
    return ancestors


@kernel
def weighted_mean(particles: Any, costs: Any, count: int, spread: float) -> Any:
    """Return the mean (D,) of the best ``count`` (N, D), by weights exp(-(W - W_best) / spread)."""
    best = costs.min()
    total = 0.0
    mean = np.zeros(particles.shape[1])
    for i in _cheapest(costs, count):
        weight = exp((best - costs[i]) / spread)
        total += weight
        for d in range(particles.shape[1]):
            mean[d] += weight * particles[i, d]
    for d in range(particles.shape[1]):
        mean[d] /= total
    return mean
