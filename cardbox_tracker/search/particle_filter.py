"""One particle filter over a few joints (paper, algorithm "Online Motion Tracking").

Each iteration resamples, propagates, clips and evaluates the particles. The initial particles are
d_ref + N(0, sigma_beta^2 E).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.search.config import FilterConfig
from cardbox_tracker.search.particle_kernels import clip, propagate, weighted_mean, weighted_stddev
from cardbox_tracker.search.resampling import Indices, resample

FloatArray = NDArray[np.float64]
CostFunction = Callable[[FloatArray], FloatArray]
"""Takes particles (N, D); returns costs (N,), px."""

SPREAD_PX = 60.0
"""Difference of costs to the best particle at which a weight is 1/e, px at 320x240."""


class ParticleFilter:
    """N particles over D joints; the given generator is the only source of randomness."""

    def __init__(
        self,
        config: FilterConfig,
        strategy: str,
        noise: FloatArray,
        limits: FloatArray,
        rng: np.random.Generator,
    ) -> None:
        """Create the filter with a strategy of :mod:`.resampling`, and no particles yet.

        ``noise`` (D,) is sigma_beta of each joint, ``limits`` (D, 2) its range, rad and metres.
        """
        self.config = config
        self.strategy = strategy
        self.noise = noise
        self._limits = limits
        self._rng = rng
        self.particles = np.zeros((config.particles, len(noise)))
        self.costs = np.zeros(config.particles)

    def initialize(
        self, posture: FloatArray, evaluate: CostFunction, noise_scale: float = 1.0
    ) -> None:
        """Create particles around ``posture`` (D,), including it, and rate them."""
        self.particles[:] = posture
        particles = self._propagated(np.arange(len(self.particles)), noise_scale)
        clip(particles, self._limits)
        self.particles, self.costs = particles, evaluate(particles)

    def iterate(
        self,
        evaluate: CostFunction,
        noise_scale: float = 1.0,
        sigma_scale: float = 1.0,
    ) -> None:
        """Run one estimation cycle, with factors on sigma_beta and sigma_gamma."""
        ancestors = resample(
            self.strategy,
            self.costs,
            self.config.survival_rate,
            self.config.sigma_gamma_px * sigma_scale,
            self._rng,
            self.config.elite,
        )
        particles = self._propagated(ancestors, noise_scale)
        clip(particles, self._limits)
        self.particles, self.costs = particles, evaluate(particles)

    def _propagated(self, ancestors: Indices, noise_scale: float) -> FloatArray:
        """Return the ancestors plus Gaussian noise, (N, D); the elite gets no noise."""
        steps = self._rng.standard_normal(self.particles.shape)
        if self.config.elite:
            steps[0] = 0.0
        propagate(steps, self.particles, ancestors, self.noise * noise_scale)
        return steps

    def best(self) -> FloatArray:
        """Return the particle (D,) of lowest cost."""
        best: FloatArray = self.particles[np.argmin(self.costs)]
        return best

    def mean(self, count: int, spread_scale: float = 1.0) -> FloatArray:
        """Return the weighted mean (D,) of the ``count`` best particles; with 1, the best one.

        The weights are exp(-(W - W_best) / (``SPREAD_PX`` ``spread_scale``)).
        """
        if count == 1:
            return self.best()
        mean: FloatArray = weighted_mean(
            self.particles, self.costs, count, SPREAD_PX * spread_scale
        )
        return mean

    def stddev(self, mean: FloatArray, spread_scale: float = 1.0) -> FloatArray:
        """Return the deviation (D,) of all particles around ``mean``, by the weights of it."""
        stddev: FloatArray = weighted_stddev(
            self.particles, self.costs, mean, SPREAD_PX * spread_scale
        )
        return stddev
