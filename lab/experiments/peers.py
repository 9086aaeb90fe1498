"""Searches that take the place of the paper's hierarchy of filters, with as many ratings.

Each searches all 12 joints at once and rates whole postures.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace

import cma
import numpy as np

from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.hierarchy import HierarchicalCost, HierarchicalFilter, SumOfTerms
from cardbox_tracker.search.particle_filter import CostFunction, ParticleFilter
from cardbox_tracker.search.resampling import multinomial
from cardbox_tracker.terms.silhouette import SilhouetteObservation

LAYERS = 5
SURVIVAL = 0.2
"""With 600 ratings, the best of 5 to 20 layers and shares of 0.05 to 0.5 on the motion wave."""
GENERATION = 20
"""Postures rated in a generation of CMA-ES."""


class WholeSearch(HierarchicalFilter):
    """A search with the ratings and the noise of Table I's three filters.

    Attributes:
        ratings: postures rated per image.
        noise: sigma_beta of d1..d12, (12,), rad and metres.
        config: settings of the three filters.
    """

    def __init__(self, config: TrackerConfig, image_px: int, rng: np.random.Generator) -> None:
        """Take sizes and noise from the filters that this search replaces."""
        super().__init__(config, image_px, rng)
        filters = self.torso, *self.arms.values()
        self.ratings = sum(len(one.particles) for one in filters)
        self.noise = np.concatenate([one.noise for one in filters])
        self.config, self.rng = config, rng

    def initialize(
        self, observation: HierarchicalCost, posture: FloatArray, noise_scale: float = 1.0
    ) -> None:
        """See :class:`HierarchicalFilter`."""
        self._estimate = self.start(_rating(observation), posture)

    def iterate(self, observation: HierarchicalCost, noise_scale: float = 1.0) -> None:
        """See :class:`HierarchicalFilter`."""
        self._estimate = self.follow(_rating(observation))

    def stddev(self) -> FloatArray:
        """Return zeros (12,), because nothing here uses deviations."""
        return np.zeros_like(self.noise)

    @abstractmethod
    def start(self, rate: CostFunction, posture: FloatArray) -> FloatArray:
        """Search the first image around ``posture`` (12,); return the result (12,)."""

    @abstractmethod
    def follow(self, rate: CostFunction) -> FloatArray:
        """Search the next image; return the result (12,)."""


def _rating(observation: HierarchicalCost) -> CostFunction:
    assert isinstance(observation, SumOfTerms)
    assert isinstance(observation.silhouette, SilhouetteObservation)
    return observation.silhouette.postures


class Flat(WholeSearch):
    """One filter without a hierarchy; survival rate and sigma_gamma are those of the torso."""

    def __init__(self, config: TrackerConfig, image_px: int, rng: np.random.Generator) -> None:
        """Make one filter of the three filters' particles."""
        super().__init__(config, image_px, rng)
        self._filter = ParticleFilter(
            replace(config.torso, particles=self.ratings),
            *(config.strategy, self.noise, JOINT_LIMITS, rng),
        )

    def start(self, rate: CostFunction, posture: FloatArray) -> FloatArray:
        """See :class:`WholeSearch`."""
        self._filter.initialize(posture, rate)
        return self._filter.best()

    def follow(self, rate: CostFunction) -> FloatArray:
        """See :class:`WholeSearch`."""
        self._filter.iterate(rate, sigma_scale=self._scale)
        return self._filter.best()


class Annealed(WholeSearch):
    """The annealed filter of Deutscher, Blake and Reid (CVPR 2000), the paper's reference [4].

    An image has several layers. A layer rates its particles and draws from weights exp(-beta W);
    the annealing rate beta is chosen such that the share ``SURVIVAL`` of the particles survives,
    that is, 1 / (N sum w^2). Each layer's noise has that share of the variance of the one before.
    The result is the mean of the last layer.
    """

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


class CmaEs(WholeSearch):
    """CMA-ES (Hansen and Ostermeier 2001), by the package ``cma``.

    It starts at the last image's result with the deviations sigma_beta; the best rated one wins.
    """

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
