"""Limits of position and speed, applied to every command of a robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray


class Limits(NamedTuple):
    """Lowest and highest positions (n,), rad or m, and highest speeds (n,), rad/s or m/s."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray


class SafeMotion:
    """Joint positions (n,) that stay within limits of position and speed.

    Attributes:
        positions: current joint positions, rad or m.
    """

    def __init__(self, limits: Limits) -> None:
        """Begin at 0 or the limit nearest to 0."""
        self._limits = limits
        zero = np.zeros(len(limits.lower))
        self.positions: FloatArray = np.clip(zero, limits.lower, limits.upper)

    def move(self, target: FloatArray, duration_s: float) -> FloatArray:
        """Move towards ``target`` (n,) for ``duration_s`` and return the new positions (n,).

        The robot stands still unless the target is finite and the duration finite and positive.
        """
        if not (np.isfinite(target).all() and np.isfinite(duration_s) and duration_s > 0.0):
            return self.positions
        lower, upper, speed = self._limits
        most = np.minimum(speed * duration_s, upper - lower)
        step = np.clip(np.clip(target, lower, upper) - self.positions, -most, most)
        self.positions = np.clip(self.positions + step, lower, upper)
        return self.positions
