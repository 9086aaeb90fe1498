"""The last step before a robot: whatever is wanted, limits and speeds hold, or it stands still."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import CardboxError


class Limits(NamedTuple):
    """Lowest and highest positions (n,), rad or m, and highest speeds (n,), rad/s or m/s."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray


class SafeMotion:
    """Joint positions (n,) that never leave their limits and never move too fast.

    Attributes:
        positions: of now.
    """

    def __init__(self, limits: Limits, start: FloatArray | None = None) -> None:
        """Stand at ``start``, by default 0, or the limit nearest to it.

        Raises:
            CardboxError: ``start`` is not within the limits.
        """
        self._limits = limits
        lower, upper = limits.lower, limits.upper
        if start is None:
            start = np.clip(np.zeros(len(lower)), lower, upper)
        if not ((start >= lower) & (start <= upper)).all():  # so written, nan is refused too
            raise CardboxError(
                f"the robot cannot start at {start}: it is beyond its joints' limits"
            )
        self.positions: FloatArray = start

    def move(self, target: FloatArray, duration_s: float) -> FloatArray:
        """Go towards ``target`` (n,) for ``duration_s``; return the positions (n,) then.

        A target or a time that is not finite, or a time that runs backwards, moves nothing.
        """
        if not (np.isfinite(target).all() and np.isfinite(duration_s) and duration_s > 0.0):
            return self.positions
        lower, upper, speed = self._limits
        most = np.minimum(speed * duration_s, upper - lower)
        step = np.clip(np.clip(target, lower, upper) - self.positions, -most, most)
        self.positions = np.clip(self.positions + step, lower, upper)
        return self.positions
