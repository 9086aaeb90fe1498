"""Expected yaw of a person who walks through the image: people face the direction of travel.

An outline from the side is nearly the same for both directions, but the motion is not.
"""

from __future__ import annotations

from math import copysign, radians

from cardbox_tracker.terms.term import Silhouette

# Lateral motion of a walking person, m; a person who sways moves up to half of it.
_WAY_M = 0.25
# Decay of the lateral motion per frame.
_FORGOTTEN = 0.05
# A person who walks sideways is seen nearly from the side.
_ASIDE_RAD = radians(80.0)


class Walk:
    """Tracks the lateral motion of a person.

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
