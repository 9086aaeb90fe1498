"""The annealed particle filter of Deutscher, Blake and Reid (CVPR 2000), the paper's reference [4].

Each image has several layers. A layer rates its particles and draws from weights exp(-beta W). The
annealing rate beta is chosen such that the share ``SURVIVAL`` of the particles survives, that is, 1
/ (N sum w^2). Each layer's noise has that share of the variance of the one before. The result is
the mean of the last layer.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.particle_filter import CostFunction
from cardbox_tracker.search.resampling import multinomial
from lab.experiments.peers.whole import WholeSearch

LAYERS = 5
SURVIVAL = 0.2
"""With 600 ratings, the best of 5 to 20 layers and shares of 0.05 to 0.5 on the motion wave."""


class Annealed(WholeSearch):
    """Five layers share the ratings of an image."""

    def start(self, rate: CostFunction, posture: FloatArray) -> FloatArray:
        """See :class:`WholeSearch`."""
        count = self.ratings // LAYERS
        self._particles = np.tile(posture, (count, 1))
        self._weights = np.full(count, 1.0 / count)
        return self.follow(rate)

    def follow(self, rate: CostFunction) -> FloatArray:
        """See :class:`WholeSearch`."""
        count = len(self._particles)
        for layer in range(LAYERS):
            noise = self.noise * SURVIVAL ** (layer / 2) * self.rng.standard_normal((count, 12))
            drawn = self._particles[multinomial(self._weights, count, self.rng)]
            self._particles = np.clip(drawn + noise, *JOINT_LIMITS.T)
            self._weights = annealed(rate(self._particles), SURVIVAL)
        mean: FloatArray = self._weights @ self._particles
        return mean


def annealed(costs: FloatArray, survival: float) -> FloatArray:
    """Return weights (N,), proportional to exp(-beta W), of which the share ``survival`` survives.

    Args:
        costs: W, (N,), px.
        survival: 1 / (N sum w^2) of the weights, between 1 / N and 1.
    """
    worse = costs - costs.min()
    low, high = -20.0, 20.0
    for _ in range(40):
        middle = (low + high) / 2
        weights: FloatArray = np.exp(-np.exp(middle) * worse)
        weights /= weights.sum()
        is_flat = 1.0 / np.sum(weights**2) > survival * len(costs)
        low, high = (middle, high) if is_flat else (low, middle)
    return weights
