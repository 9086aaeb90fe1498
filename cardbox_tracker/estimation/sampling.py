"""Postures that an estimate stands for, from its mean and standard deviations alone."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.posture import TURNING_LIMITS
from cardbox_tracker.body.sizes import FloatArray


def normal_postures(
    posture: FloatArray, stddev: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return postures (count, 12): each joint normal by itself, kept in its limits.

    What the joints have to do with each other, and that a posture in depth may be mirrored, is not
    in means and deviations; :meth:`.tracker.Tracker.sample` knows it.

    Args:
        posture: mean, (12,), rad and metres.
        stddev: standard deviations, (12,).
        count: how many.
        rng: source of the noise.
    """
    noise = rng.standard_normal((count, len(posture)))
    drawn: FloatArray = np.clip(
        posture + stddev * noise, TURNING_LIMITS[:, 0], TURNING_LIMITS[:, 1]
    )
    return drawn
