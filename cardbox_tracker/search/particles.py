"""The weighted particles of a frame, for samples of the posterior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.person.posture import POSTURE, TURNING_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.doubt import calibrated_deviations


def normal_postures(
    posture: FloatArray, stddev: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return postures (count, 12) with independent normal joints, clipped to their limits.

    They have neither the correlations nor the mirror ambiguity in depth of :func:`likely_postures`.
    Mean and deviations are (12,), rad and metres.
    """
    noise = rng.standard_normal((count, len(posture)))
    drawn: FloatArray = np.clip(
        posture + stddev * noise, TURNING_LIMITS[:, 0], TURNING_LIMITS[:, 1]
    )
    return drawn


def likely_postures(
    posture: FloatArray | None,
    stddev: FloatArray | None,
    offset_m: FloatArray | None,
    particles: Particles | None,
    count: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return equally weighted samples (count, 12) of the posterior of an estimate.

    They are drawn from the ``particles`` of the same image, which need ``offset_m``, or by
    :func:`normal_postures`. Raises ValueError if the estimate has no posture.
    """
    if posture is None or stddev is None:
        raise ValueError("the estimate has no posture to sample from")
    if particles is None or offset_m is None:
        return normal_postures(posture, stddev, count, rng)
    return particles.postures(np.concatenate([posture, offset_m]), count, rng)


@dataclass(frozen=True)
class Particles:
    """Rated states; each has the weight exp(-rating / ``spread``)."""

    states: FloatArray  #: (N, 14)
    ratings: FloatArray  #: ratings of the states, (N,)
    mean: FloatArray  #: mean of the states, (14,), before smoothing
    spread: float  #: difference of ratings that changes a weight by the factor e

    def postures(self, around: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
        """Return equally weighted postures (count, 12) with the deviations of ``around`` (14,)."""
        weights = np.exp((self.ratings.min() - self.ratings) / self.spread)
        chosen = rng.choice(len(weights), count, p=weights / weights.sum())
        deviations = calibrated_deviations(self.states[chosen] - self.mean, rng)
        postures = (around + deviations)[:, POSTURE]
        drawn: FloatArray = np.clip(postures, *TURNING_LIMITS.T)
        return drawn
