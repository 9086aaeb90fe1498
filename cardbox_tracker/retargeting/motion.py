"""Motion of a robot's joints between commands, within limits of position and speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray


class Limits(NamedTuple):
    """Lowest and highest positions (n,), rad or m, and highest speeds (n,), rad/s or m/s."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray


class Moment(NamedTuple):
    """Positions (n,), rad or m, and velocities (n,), rad/s or m/s, at one time."""

    positions: FloatArray
    velocities: FloatArray


class SafeMotion:
    """A motion with constant velocities that ends at the goal and stands still from there.

    Attributes:
        goal: joint positions (n,) at the end, rad or m.
    """

    def __init__(self, limits: Limits) -> None:
        """Stand still at 0 or the limit nearest to 0."""
        self._limits = limits
        zero = np.zeros(len(limits.lower))
        self.goal: FloatArray = np.clip(zero, limits.lower, limits.upper)
        self._start, self._begun_ns, self._duration_ns = self.goal, 0, 0

    def at(self, now_ns: int) -> Moment:
        """Return positions and velocities at a time of the robot's clock, ns."""
        passed_ns, whole_ns = now_ns - self._begun_ns, self._duration_ns
        if not 0 <= passed_ns < whole_ns:
            return Moment(self.goal, np.zeros(len(self.goal)))
        way = self.goal - self._start
        return Moment(self._start + passed_ns / whole_ns * way, way / (whole_ns / 1e9))

    def stop(self, now_ns: int) -> FloatArray:
        """Stand still from ``now_ns`` on and return the positions (n,)."""
        self.goal = self.at(now_ns).positions
        self._duration_ns = 0
        return self.goal

    def move(self, target: FloatArray, now_ns: int, duration_ns: int) -> FloatArray:
        """Move towards ``target`` (n,) for a time from now on and return the goal (n,).

        The robot stands still unless the target is finite and the time is positive.
        """
        self.stop(now_ns)
        if np.isfinite(target).all() and duration_ns > 0:
            lower, upper, speed = self._limits
            most = np.minimum(speed * (duration_ns / 1e9), upper - lower)
            step = np.clip(np.clip(target, lower, upper) - self.goal, -most, most)
            self._start, self._begun_ns, self._duration_ns = self.goal, now_ns, duration_ns
            self.goal = np.clip(self._start + step, lower, upper)
        return self.goal
