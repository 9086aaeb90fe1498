"""The weighted particles of a frame, for samples of the posterior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.person.posture import POSTURE, TURNING_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.doubt import calibrated_deviations


@dataclass(frozen=True)
class Particles:
    """Rated states; each has the weight exp(-rating / ``spread``)."""

    states: FloatArray  #: (N, 14)
    ratings: FloatArray  #: ratings of the states, (N,)
    mean: FloatArray  #: mean of the states, (14,), before smoothing
    spread: float  #: difference of ratings that changes a weight by the factor e

    def postures(self, around: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Return equally weighted postures (count, 12), drawn from the weighted particles.

        They are moved ``around`` the result (14,) and have its deviations.
        """
        weights = np.exp((self.ratings.min() - self.ratings) / self.spread)
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        deviations = calibrated_deviations(self.states[chosen] - self.mean, rng)
        postures = (around + deviations)[:, POSTURE]
        drawn: FloatArray = np.clip(postures, *TURNING_LIMITS.T)
        return drawn
