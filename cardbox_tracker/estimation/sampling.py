"""Postures that an estimate stands for: from particles, or from mean and deviations alone."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.posture import TURNING_LIMITS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.filtering.particles import Particles


def normal_postures(
    posture: FloatArray, stddev: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return postures (count, 12): each joint normal by itself, kept in its limits.

    What the joints have to do with each other, and that a posture in depth may be mirrored, is not
    in means and deviations; :func:`likely_postures` knows it.

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


def likely_postures(
    posture: FloatArray | None,
    stddev: FloatArray | None,
    offset_m: FloatArray | None,
    particles: Particles | None,
    count: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return postures (count, 12), equally likely, that an estimate stands for.

    They come from the particles; without any of whole states, from :func:`normal_postures`.

    Args:
        posture: of the estimate, (12,).
        stddev: its standard deviations, (12,).
        offset_m: its ``torso_x`` and ``torso_z``, (2,), which particles need.
        particles: of the same image.
        count: how many.
        rng: source of the draws.

    Raises:
        ValueError: the estimate has no posture.
    """
    if posture is None or stddev is None:
        raise ValueError("an estimate without a posture stands for none")
    if particles is None or offset_m is None:
        return normal_postures(posture, stddev, count, rng)
    return particles.postures(np.concatenate([posture, offset_m]), count, rng)
