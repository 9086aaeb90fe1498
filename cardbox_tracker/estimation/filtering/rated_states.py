"""States of one frame with their ratings and the joints of their arms."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.filtering import state_choice


class RatedStates(NamedTuple):
    """N rated states.

    Attributes:
        states: states of the first camera, (N, 14).
        ratings: ratings, (N,); lower is better.
        joints_m: shoulder, elbow, hand of both arms in the torso's frame, (N, 6, 3), metres.
        keypoints_m: the same in the optical frame, (N, 6, 3), metres.
    """

    states: FloatArray
    ratings: FloatArray
    joints_m: FloatArray
    keypoints_m: FloatArray

    @classmethod
    def of(cls, states: FloatArray, cost: MultiViewCost) -> RatedStates:
        """Rate states (N, 14)."""
        rated = cost.bodies(states)
        return cls(states, rated.ratings, *rated.points)

    @classmethod
    def of_pairs(cls, states: FloatArray, cost: MultiViewCost) -> RatedStates:
        """Rate states (N, 14), N > 0, with the trunk that ``cost`` has fixed."""
        ratings, points = cost.pairs(states)
        return cls(states, ratings, *points)

    def joined(self, other: RatedStates) -> RatedStates:
        """Return these states, and then those of ``other``."""
        return RatedStates(*(np.concatenate(both) for both in zip(self, other, strict=True)))

    def best(self, count: int) -> FloatArray:
        """Return the best ``count`` states, (count, 14), best first; all if there are fewer."""
        return state_choice.best_states(self.states, self.ratings, min(count, len(self.states)))

    def different(self, most: int, alike: int, apart_m: float) -> FloatArray:
        """Return up to ``most`` states (M, 14), see :func:`~.state_choice.choose_apart`."""
        kept = state_choice.choose_apart(
            self.states, self.ratings, self.joints_m, most, alike, apart_m
        )
        return self.states[kept]
