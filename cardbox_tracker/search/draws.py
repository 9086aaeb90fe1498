"""Random numbers of a search, which are drawn in one call because each call is slow."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.posture import ARM_ANGLES, N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.whole_body_config import SearchProfile

# Uniform numbers per torso, per arm, and per state of the last rounds.
_OF_TORSO, _OF_ARM, _OF_STATE = 2, 3, 2


class Draws:
    """Supplies the normal numbers and the uniform numbers in 0..1 of one search."""

    def __init__(self, rng: np.random.Generator, config: SearchProfile) -> None:
        """Draw all numbers; ``config`` has the numbers of torsos, arms and states."""
        c, together = config, config.rounds * config.together
        # One arm of each group of candidates is rated, and all groups are complete.
        self._arms, self._near = (
            max(count // c.candidates, 1) * c.candidates for count in (c.arms, c.arms_again)
        )
        arms = 2 * self._arms
        normals = (c.torsos + together) * N_STATE + (arms + 2 * self._near) * ARM_ANGLES
        uniforms = c.torsos * _OF_TORSO + arms * _OF_ARM + together * _OF_STATE
        self._normals = _Numbers(rng.standard_normal(normals))
        self._uniforms = _Numbers(rng.random(uniforms))

    def for_torsos(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return normal numbers (count, 14) and uniform ones (count, 2)."""
        return self._normals.take(count, N_STATE), self._uniforms.take(count, _OF_TORSO)

    def for_arms(self) -> tuple[FloatArray, FloatArray]:
        """Return normal numbers (N, 4) and uniform ones (N, 3) for N proposed arms of a side."""
        count = self._arms
        return self._normals.take(count, ARM_ANGLES), self._uniforms.take(count, _OF_ARM)

    def for_near_arms(self) -> FloatArray:
        """Return normal numbers (N, 4) for the N arms of a side around the best ones."""
        return self._normals.take(self._near, ARM_ANGLES)

    def for_states(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Return normal numbers (count, 14) and uniform ones (count, 2)."""
        return self._normals.take(count, N_STATE), self._uniforms.take(count, _OF_STATE)


class _Numbers:
    def __init__(self, values: FloatArray) -> None:
        self._values, self._next = values, 0

    def take(self, rows: int, columns: int) -> FloatArray:
        start, self._next = self._next, self._next + rows * columns
        return self._values[start : self._next].reshape(rows, columns)
