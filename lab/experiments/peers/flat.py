"""The paper's particle filter without its hierarchy: one filter of 12 joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.particle_filter import CostFunction, ParticleFilter
from lab.experiments.peers.whole import WholeSearch


class Flat(WholeSearch):
    """Resampling as configured; survival rate and sigma_gamma are those of the torso."""

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
