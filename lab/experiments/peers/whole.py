"""Base of the peers: a search of all 12 joints at once, which rates whole postures."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.hierarchy import HierarchicalCost, HierarchicalFilter, SumOfTerms
from cardbox_tracker.search.particle_filter import CostFunction
from cardbox_tracker.terms.silhouette import SilhouetteObservation


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
