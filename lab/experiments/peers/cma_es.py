"""CMA-ES (Hansen and Ostermeier 2001) as an optimiser of each image, by the package ``cma``."""

from __future__ import annotations

import cma
import numpy as np

from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.particle_filter import CostFunction
from lab.experiments.peers.whole import WholeSearch

GENERATION = 20
"""Postures rated in a generation."""


class CmaEs(WholeSearch):
    """Starts at the last image's result with the deviations sigma_beta; the best rated one wins."""

    def start(self, rate: CostFunction, posture: FloatArray) -> FloatArray:
        """See :class:`WholeSearch`."""
        self._estimate = posture
        return self.follow(rate)

    def follow(self, rate: CostFunction) -> FloatArray:
        """See :class:`WholeSearch`."""
        options = {
            "popsize": GENERATION,
            "CMA_stds": self.noise,
            "bounds": list(JOINT_LIMITS.T),
            "seed": np.nan,
            "randn": lambda *shape: self.rng.standard_normal(shape),
            "verbose": -9,
        }
        search = cma.CMAEvolutionStrategy(self._estimate, 1.0, options)
        best, lowest = self._estimate, np.inf
        for _ in range(self.ratings // GENERATION):
            postures = np.array(search.ask())
            costs = rate(postures)
            search.tell(list(postures), costs.tolist())
            if costs.min() < lowest:
                best, lowest = postures[np.argmin(costs)], float(costs.min())
        return best
