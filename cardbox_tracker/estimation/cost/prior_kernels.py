"""The sum of squares of the rest prior, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.compiling import njit


@njit(cache=True, nogil=True, error_model="numpy")
def squared_distances(particles: Any, below: Any, above: Any, weight: float) -> Any:
    """Return ``weight`` times the squared distances (N,) of particles (N, D) from rest.

    A value is measured in units of 1/``above`` (D,) where it is positive, of 1/``below`` (D,) where
    it is negative.
    """
    costs = np.empty(particles.shape[0])
    for i in range(particles.shape[0]):
        squares = 0.0
        for d in range(particles.shape[1]):
            value = particles[i, d]
            scaled = value * (below[d] if value < 0.0 else above[d])
            squares += scaled * scaled
        costs[i] = weight * squares
    return costs
