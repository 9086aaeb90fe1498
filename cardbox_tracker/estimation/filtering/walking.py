"""Which way somebody faces who walks through the image: where they are going.

An outline from the side is nearly alike for both directions; the way across the image is not.
"""

from __future__ import annotations

from math import copysign, radians

from cardbox_tracker.estimation.cost.terms import Silhouette

# Way that counts, m: half of it is swaying, all of it is walking.
_WAY_M = 0.25
# Share of the way that is forgotten from one frame to the next.
_FORGOTTEN = 0.05
# Somebody who walks across is seen nearly from the side.
_ASIDE_RAD = radians(80.0)


class Walk:
    """Follows somebody across the image.

    Attributes:
        way_m: the way made lately, towards positive ``torso_y``, metres.
    """

    def __init__(self) -> None:
        """Begin with somebody of whom nothing is known."""
        self._bearing: float | None = None
        self.way_m = 0.0

    def see(self, silhouette: Silhouette, bearing: float, ahead_m: float) -> float:
        """Take the next silhouette (H, W).

        Somebody who is first seen at a border of the image is assumed to come in.

        Args:
            silhouette: the foreground.
            bearing: of its middle, aside over ahead.
            ahead_m: how far away the person is.

        Returns:
            How far the middle moved since the last silhouette, metres.
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
        """Yaw of the torso that the way suggests: 0 unless somebody walks."""
        walking = max(0.0, 2.0 * abs(self.way_m) / _WAY_M - 1.0)
        return copysign(_ASIDE_RAD * walking, self.way_m)
