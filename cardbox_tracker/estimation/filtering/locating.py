"""Where the person stands in a frame, before any posture is searched."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import STATE_LIMITS, TORSO_X, TORSO_Y
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.filtering.walking import Walk

# Deviation of where lines of sight meet: medians of outlines are not the same point of a body.
_CROSSING_M = 0.1
# Lines of sight that are less apart, as the sine of the angle between them, do not measure x.
_LEAST_ANGLE = 0.05


class Location(NamedTuple):
    """Where the person seems to stand.

    Attributes:
        bearing: of the silhouette's middle in the first camera, aside over ahead.
        step_m: how far the middle moved across the first camera's image since the last frame.
        x_m: ``torso_x`` where the lines of sight meet; None where that is not looked for.
        x_stddev_m: its standard deviation; None where a single line says little of it.
    """

    bearing: float
    step_m: float
    x_m: float | None = None
    x_stddev_m: float | None = None


class Locator:
    """Follows where the person stands, and which way they walk."""

    def __init__(
        self, cost: MultiViewCost, distance_m: float, views: Sequence[View], crosses: bool
    ) -> None:
        """Prepare.

        Args:
            cost: it tells the bearings.
            distance_m: of the hips from the first camera, in the body model.
            views: of the further cameras.
            crosses: whether lines of sight are crossed.
        """
        self._cost, self._distance_m = cost, distance_m
        self._views, self._crosses = views, crosses
        self.forget()

    def forget(self) -> None:
        """Begin with somebody of whom nothing is known."""
        self._walk = Walk()

    @property
    def yaw_rad(self) -> float:
        """Yaw of the torso that the way across the image suggests."""
        return self._walk.yaw_rad

    def locate(
        self, frames: Sequence[Frame], seeing: Sequence[int], before: FloatArray
    ) -> Location:
        """Return where the person is.

        Args:
            frames: of all cameras, which the cost has seen.
            seeing: cameras that see the person, by their number.
            before: the state (14,) of the frame before.
        """
        costs, step_m = self._cost.costs, 0.0
        bearings = {number: costs[number].bearing() for number in seeing}
        if 0 in seeing:
            ahead_m = self._distance_m - float(before[TORSO_X])
            step_m = self._walk.see(frames[0].silhouette, bearings[0], ahead_m)
        if not self._crosses:
            return Location(bearings[0], step_m)
        there = np.array([float(before[TORSO_X]) - self._distance_m, float(before[TORSO_Y])])
        x, y = crossing_of([self._line(*one) for one in bearings.items()], there)
        x_m = float(np.clip(x + self._distance_m, *STATE_LIMITS[TORSO_X]))
        stddev_m = None if list(seeing) == [0] else _CROSSING_M
        return Location(y / max(-x, 1e-3), step_m, x_m, stddev_m)

    def _line(self, number: int, bearing: float) -> tuple[FloatArray, FloatArray]:
        if number:
            return self._views[number - 1].line_of_sight(bearing)
        return np.zeros(2), np.array([-1.0, bearing]) / np.hypot(1.0, bearing)


def crossing_of(
    lines: Iterable[tuple[FloatArray, FloatArray]], before: FloatArray
) -> tuple[float, float]:
    """Return the point (x, y) where lines meet; of a single line, the point nearest to ``before``.

    Least squares of the distances from all lines, and a little of that from ``before``.

    Args:
        lines: a point and the direction, a unit vector, of each, (2,), in the first camera's level
            frame, metres.
        before: where the person was, (2,), metres.
    """
    normal, right = _LEAST_ANGLE**2 * np.eye(2), _LEAST_ANGLE**2 * before
    for place, ahead in lines:
        across = np.eye(2) - np.outer(ahead, ahead)
        normal = normal + across
        right = right + across @ place
    x, y = np.linalg.solve(normal, right).tolist()
    return x, y
