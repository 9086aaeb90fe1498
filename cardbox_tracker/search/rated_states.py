"""States of one frame with their ratings and the joints of their arms; draws for new ones."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.posture import ARM_ANGLES, N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import state_choice
from cardbox_tracker.search.whole_body_config import SearchProfile
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.whole_body import Ratings

_SHAPES = (N_STATE,), (), (6, 3), (6, 3)
# States for which there is memory at first.
_USUAL = 256


class RatedStates:
    """Rated states of one frame; others can be added.

    Attributes:
        states: states of the first camera, (N, 14).
        ratings: ratings, (N,); lower is better.
        joints_m: shoulder, elbow, hand of both arms in the torso's frame, (N, 6, 3), metres.
        keypoints_m: the same in the optical frame, (N, 6, 3), metres.
    """

    def __init__(self, cost: MultiViewCost) -> None:
        self._cost = cost
        self._storage = [np.empty((_USUAL, *shape)) for shape in _SHAPES]
        self._use(0)

    def _use(self, count: int) -> None:
        states, ratings, joints_m, keypoints_m = self._storage
        self.states, self.ratings = states[:count], ratings[:count]
        self.joints_m, self.keypoints_m = joints_m[:count], keypoints_m[:count]

    def add(self, states: FloatArray) -> None:
        """Rate and add states (N, 14)."""
        self._cost.bodies(states, self._place(states))

    def add_pairs(self, states: FloatArray) -> None:
        """Rate and add states (N, 14), N > 0, with the trunk that the cost has fixed."""
        self._cost.pairs(states, self._place(states))

    def _place(self, states: FloatArray) -> Ratings:
        """Add states (N, 14) and return the memory of their ratings."""
        begin, count = len(self.states), len(self.states) + len(states)
        while count > len(self._storage[0]):
            self._storage = [np.concatenate([stored, stored]) for stored in self._storage]
        self._use(count)
        self.states[begin:] = states
        return Ratings(self.ratings[begin:], self.joints_m[begin:], self.keypoints_m[begin:])

    def best(self, count: int) -> FloatArray:
        """Return the best ``count`` states, (count, 14), best first; all if there are fewer."""
        return state_choice.best_states(self.states, self.ratings, min(count, len(self.states)))

    def different(self, most: int, alike: int, apart_m: float) -> FloatArray:
        """Return up to ``most`` states (M, 14), see :func:`~.state_choice.choose_apart`."""
        kept = state_choice.choose_apart(
            self.states, self.ratings, self.joints_m, most, alike, apart_m
        )
        return self.states[kept]


# Uniform numbers per arm, and per state.
_OF_ARM, _OF_STATE = 3, 2


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
        uniforms = (c.torsos + together) * _OF_STATE + arms * _OF_ARM
        self._normals = _Numbers(rng.standard_normal(normals))
        self._uniforms = _Numbers(rng.random(uniforms))

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
