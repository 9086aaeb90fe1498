"""The person's place in a frame, and the yaw of who walks, before the search of the posture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import copysign, hypot, radians
from typing import NamedTuple

from cardbox_tracker.camera.view import LevelPoint, View
from cardbox_tracker.person.posture import TORSO_X, TORSO_Y
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Frame, Silhouette

# Lateral motion of a walking person, m; a person who sways moves up to half of it.
_WAY_M = 0.25
# Decay of the lateral motion per frame.
_FORGOTTEN = 0.05
# A person who walks sideways is seen nearly from the side.
_ASIDE_RAD = radians(80.0)


class Walk:
    """The lateral motion of a person, who faces the direction of travel.

    An outline from the side is nearly the same for both directions, but the motion is not.

    Attributes:
        way_m: decaying sum of the recent motion, positive towards positive ``torso_y``, metres.
    """

    def __init__(self) -> None:
        """Begin without a person."""
        self._bearing: float | None = None
        self.way_m = 0.0

    def see(self, silhouette: Silhouette, bearing: float, ahead_m: float) -> float:
        """Return the lateral motion of the next silhouette (H, W), 0 or 255, metres.

        ``bearing`` is the lateral coordinate over depth of its middle, ``ahead_m`` the distance. A
        person who first appears at a border of the image is assumed to walk in.
        """
        if self._bearing is None:
            step_m = 0.0
            left, right = (bool(silhouette[:, edge].any()) for edge in (0, -1))
            self.way_m = _WAY_M * (left - right)
        else:
            step_m = (bearing - self._bearing) * ahead_m
            way_m = (1.0 - _FORGOTTEN) * self.way_m + step_m
            self.way_m = min(max(way_m, -_WAY_M), _WAY_M)
        self._bearing = bearing
        return step_m

    @property
    def yaw_rad(self) -> float:
        """Expected yaw of the torso, rad; 0 unless the person walks."""
        walking = max(0.0, 2.0 * abs(self.way_m) / _WAY_M - 1.0)
        return copysign(_ASIDE_RAD * walking, self.way_m)


# Deviation of the intersection, m: median columns of two cameras show different body points.
_CROSSING_M = 0.1
# Least sine of the angle between lines of sight that determine x.
_LEAST_ANGLE = 0.05


class Location(NamedTuple):
    """Estimated place of the person."""

    bearing: float  #: lateral coordinate over depth of the silhouette's middle in the first camera
    step_m: float  #: lateral motion of the middle since the last frame, metres
    #: ``torso_x`` of the intersection of the lines of sight; None with one camera.
    x_m: float | None = None
    #: standard deviation of ``x_m``; None if the lines do not determine it.
    x_stddev_m: float | None = None


class Locator:
    """Tracks the place and the walking direction of the person."""

    def __init__(self, cost: MultiViewCost, distance_m: float, views: Sequence[View]) -> None:
        """Prepare for ``views`` of further cameras; ``distance_m`` is that of the body model."""
        self._cost, self._distance_m, self._views = cost, distance_m, views
        self.forget()

    def forget(self) -> None:
        """Forget the person."""
        self._walk = Walk()

    @property
    def yaw_rad(self) -> float:
        """Expected yaw of the torso from the lateral motion."""
        return self._walk.yaw_rad

    def locate(
        self, frames: Sequence[Frame], seeing: Sequence[int], before: FloatArray
    ) -> Location:
        """Return the place of the person in frames of all cameras, of which ``seeing`` show them.

        The cost has their silhouettes; ``before`` (14,) is the state of the previous frame.
        """
        costs, step_m = self._cost.costs, 0.0
        bearings = {number: costs[number].bearing() for number in seeing}
        if 0 in seeing:
            ahead_m = self._distance_m - float(before[TORSO_X])
            step_m = self._walk.see(frames[0].silhouette, bearings[0], ahead_m)
        if not self._views:
            return Location(bearings[0], step_m)
        there = float(before[TORSO_X]) - self._distance_m, float(before[TORSO_Y])
        x, y = crossing_of([self._line(*one) for one in bearings.items()], there)
        lowest_m, highest_m = self._cost.limits[TORSO_X].tolist()
        x_m = min(max(x + self._distance_m, lowest_m), highest_m)
        stddev_m = None if list(seeing) == [0] else _CROSSING_M
        return Location(y / max(-x, 1e-3), step_m, x_m, stddev_m)

    def _line(self, number: int, bearing: float) -> tuple[LevelPoint, LevelPoint]:
        if number:
            return self._views[number - 1].line_of_sight(bearing)
        length = hypot(1.0, bearing)
        return (0.0, 0.0), (-1.0 / length, bearing / length)


def crossing_of(
    lines: Iterable[tuple[LevelPoint, LevelPoint]], before: LevelPoint
) -> tuple[float, float]:
    """Return the intersection (x, y) of lines; of a single line, the point nearest to ``before``.

    The point minimizes the sum of the squared distances from all lines, plus a small multiple of
    the squared distance from ``before``. With unit directions a, it solves

        (w I + sum of (I - a a^T)) x = w before + sum of (I - a a^T) place

    All are metres in the first level frame.
    """
    # Without numpy, whose calls for such small matrices take ten times as long.
    weight = _LEAST_ANGLE**2
    xx, xy, yy = weight, 0.0, weight
    right_x, right_y = weight * before[0], weight * before[1]
    for (x, y), (ahead_x, ahead_y) in lines:
        of_xx, of_xy, of_yy = 1.0 - ahead_x**2, -ahead_x * ahead_y, 1.0 - ahead_y**2
        xx, xy, yy = xx + of_xx, xy + of_xy, yy + of_yy
        right_x += of_xx * x + of_xy * y
        right_y += of_xy * x + of_yy * y
    determinant = xx * yy - xy**2
    return (yy * right_x - xy * right_y) / determinant, (xx * right_y - xy * right_x) / determinant
