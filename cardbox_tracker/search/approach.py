"""Motion of a person towards the camera or away from it: proposals and priors of ``torso_x``.

The priors hold a standing person at the usual place, the *home*, and near the last place, because
an outline alone shows a distance poorly. If the person leaves the home, both move with the speed of
the last frames.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.person.posture import TORSO_X, TORSO_Y
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Frame, Silhouette

# Multiples of the last distance at which the last posture is proposed.
_SCALES = np.exp([-0.16, -0.08, -0.04, 0.04, 0.08, 0.16])
DISTANCES_M: FloatArray = 0.7 * 1.12 ** np.arange(22, dtype=np.float64)
"""Distances at which an upright person is sought who appears or is lost, m."""
# Another distance must have this part of the differing pixels at the expected one.
_BETTER = 0.6
# Distance from the home at which a person begins to walk, and farthest home, m.
_WALKING_M, _HOME_M = 0.1, 0.25
# Weight of a frame in the speed.
_SPEED_RATE = 0.3


class Approach:
    """Tracks home and speed of a person along the line of sight.

    Attributes:
        home_m: usual ``torso_x``.
        expected_m: ``torso_x`` that is expected in the present frame.
        is_fixed: whether the person stays at the distance of the body model, so that no other
            distances are proposed.
    """

    is_fixed = False

    def __init__(self, home_rate: float) -> None:
        """Begin at the measured place; ``home_rate`` is a frame's weight in the home."""
        self._rate = home_rate
        self.begin(0.0)

    def begin(self, x_m: float) -> None:
        """Expect a person who stands at this ``torso_x``."""
        x_m = 0.0 if self.is_fixed else x_m
        self.home_m = self._home_m = self.expected_m = self._last_m = x_m
        self._speed_m = 0.0

    def see(self, x_m: float) -> None:
        """Update with ``torso_x`` of the last frame."""
        if self.is_fixed:
            return
        self._speed_m += _SPEED_RATE * (x_m - self._last_m - self._speed_m)
        self._last_m = x_m
        self._home_m += self._rate * (x_m - self._home_m)
        self._home_m = min(max(self._home_m, x_m - _HOME_M), x_m + _HOME_M)
        walking = min(max(abs(x_m - self._home_m) / _WALKING_M - 1.0, 0.0), 1.0)
        self.expected_m = x_m + walking * self._speed_m
        self.home_m = self._home_m + walking * (self.expected_m - self._home_m)

    def nearer_and_farther(self, state: FloatArray, cost: MultiViewCost) -> FloatArray:
        """Return a state (14,) a step nearer and farther, (N, 14), within the limits."""
        body_m = cost.place[0]
        scales = _SCALES[:0] if self.is_fixed else _SCALES
        distances_m = scales * (body_m - float(state[TORSO_X]))
        return at_distances(state, distances_m, body_m, cost.limits)

    def with_upright(
        self,
        cost: MultiViewCost,
        frames: Sequence[Frame],
        survivors: FloatArray,
        reference: FloatArray,
        bearing: float,
        is_new: bool,
    ) -> FloatArray:
        """Return ``survivors`` (N, 14), best first, with upright states at the silhouette's place.

        The person is expected at the place of the first one; the last one is replaced.
        ``reference`` (14,) is the front posture, ``bearing`` the lateral coordinate over depth of
        the silhouette; the survivors of somebody who ``is_new`` mean nothing.
        """
        upright, kept = reference.copy(), survivors.copy()
        upright[TORSO_Y] = bearing * cost.place[0]
        upright = np.clip(upright, *cost.limits.T)
        if is_new:
            kept[0] = upright
        found = None
        if not self.is_fixed:
            found = placed_upright(cost, [frame.silhouette for frame in frames], kept[0], upright)
        kept[-1] = upright
        if found is not None:
            kept = np.roll(kept, 1, axis=0)
            kept[0] = found
        self.begin(float(kept[0, TORSO_X]))
        return kept


def at_distances(
    state: FloatArray, distances_m: FloatArray, body_m: float, limits: FloatArray
) -> FloatArray:
    """Return a state (14,) at other distances, at the same column of the image, (N, 14).

    ``distances_m`` (N,) and ``body_m``, that of the body model, are those of the hips; ``limits``
    (14, 2) are those of a state.
    """
    states = np.repeat(state[None], len(distances_m), axis=0)
    states[:, TORSO_X] = body_m - distances_m
    states[:, TORSO_Y] *= distances_m / max(body_m - float(state[TORSO_X]), 1e-3)
    return np.clip(states, *limits.T)


def placed_upright(
    cost: MultiViewCost,
    silhouettes: list[Silhouette],
    expected: FloatArray,
    upright: FloatArray,
) -> FloatArray | None:
    """Return an upright state (14,) that fits better than ``expected``, at any distance, or None.

    The rows of the image that count depend on the distance, so each state is rated with its own.
    ``expected`` is preferred to states of a similar rating; ``upright`` is at the column of the
    silhouettes (H, W). The cost then has these for the better state.
    """
    seeing = cost.seeing
    candidates = [
        np.clip(expected, *cost.limits.T),
        *at_distances(upright, DISTANCES_M, cost.place[0], cost.limits),
    ]
    misfits = []
    for state in candidates:
        cost.see(silhouettes, state)
        cost.choose(seeing)
        # A body beside the image or above the silhouette covers nothing and misses nothing.
        is_there = cost.silhouette_px > 0
        pixels = cost.bodies(state[None]).costs_px[0] if is_there else np.inf
        misfits.append(pixels / max(cost.silhouette_px, 1))
    misfits[0] *= _BETTER
    best = int(np.argmin(misfits))
    cost.see(silhouettes, candidates[best])
    cost.choose(seeing)
    return candidates[best] if best else None
