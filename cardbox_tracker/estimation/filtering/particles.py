"""The particles of a frame, kept for those who want to know what else was possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.estimation.filtering.loss import calibrated_states


@dataclass(frozen=True)
class Particles:
    """States (N, 14) that were rated, (N,); each weighs exp(-rating / ``spread``).

    ``mean`` (14,) is their mean, before it was smoothed.
    """

    states: FloatArray
    ratings: FloatArray
    mean: FloatArray
    spread: float

    def postures(self, around: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Return postures (count, 12), equally likely: particles drawn by their weights.

        They are spread ``around`` a state (14,), the result, as far as its calibrated deviations
        say.
        """
        weights = np.exp((self.ratings.min() - self.ratings) / self.spread)
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        deviations = self.states[chosen] - self.mean
        return calibrated_states(deviations, rng, STATE_LIMITS, around)[:, :N_JOINTS]
