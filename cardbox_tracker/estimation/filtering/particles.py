"""The particles of a frame, kept for those who want to know what else was possible."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.posture import N_JOINTS, STATE_LIMITS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.filtering.loss import calibrated_deviations


@dataclass(frozen=True)
class Particles:
    """States that were rated; each weighs exp(-rating / ``spread``).

    Attributes:
        states: (N, 14).
        ratings: (N,), pixels.
        mean: of the states, (14,), before it was smoothed.
        spread: difference of ratings that changes a weight by e, pixels.
        scale: the deviations that are told of the result, divided by those of the states, (14,).
    """

    states: FloatArray
    ratings: FloatArray
    mean: FloatArray
    spread: float
    scale: FloatArray

    def postures(self, around: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Return postures (count, 12), equally likely: particles drawn by their weights.

        They are spread ``around`` a state (14,), the result, as far as its deviations say.
        """
        weights = np.exp((self.ratings.min() - self.ratings) / self.spread)
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        deviations = self.scale * calibrated_deviations(self.states[chosen] - self.mean, rng)
        drawn: FloatArray = np.clip(around + deviations, *STATE_LIMITS.T)
        return drawn[:, :N_JOINTS]
