"""The whole-body filter's search of one arm beside a fixed torso."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import arm_proposals, state_choice
from cardbox_tracker.search.arms import ARM_LIMITS, propose_arms
from cardbox_tracker.search.draws import Draws
from cardbox_tracker.search.whole_body_config import SearchProfile
from cardbox_tracker.terms.multi_view import MultiViewCost

# Noise around the best arms, as a fraction of the usual noise.
_AGAIN_NOISE = 0.45


class ArmSearch:
    """Searches arms (N, 4) with all cameras of a cost, beside its fixed torso.

    Attributes:
        spreads_m: deviations of left elbow and hand, right elbow and hand, in the last frame, m.
    """

    def __init__(self, cost: MultiViewCost) -> None:
        """Prepare for searches with ``cost``."""
        self._cost = cost
        self.forget()

    def forget(self) -> None:
        """Forget the last frame."""
        self.spreads_m: list[float] = [0.0, 0.0, 0.0, 0.0]

    def __call__(
        self, pool: FloatArray, arm: int, profile: SearchProfile, draws: Draws
    ) -> tuple[FloatArray, FloatArray]:
        """Return arms (N, 4), 0 left or 1 right, and their ratings (N,).

        The states ``pool`` (M, 14) have this torso, the best first.
        """
        cost = self._cost
        arms = self._proposed(pool, arm, profile, *draws.for_arms())
        ratings, joints_m = cost.arms(arms, arm)
        self.spreads_m[2 * arm : 2 * arm + 2] = state_choice.spread_of_arm(
            joints_m, ratings, profile.spread
        )
        near = arm_proposals.around_best(
            arms,
            ratings,
            profile.best_arms,
            _AGAIN_NOISE * profile.arm_noise_rad,
            ARM_LIMITS,
            draws.for_near_arms(),
        )
        near = self.promising(near, arm, profile.candidates)
        return np.concatenate([arms, near]), np.concatenate([ratings, cost.arms(near, arm)[0]])

    def _proposed(
        self,
        pool: FloatArray,
        arm: int,
        profile: SearchProfile,
        normals: FloatArray,
        uniforms: FloatArray,
    ) -> FloatArray:
        """Return arms (N, 4), of which each camera that shows the person proposes an equal part.

        Each camera uses its own uncovered foreground and line of sight.
        """
        cost, candidates = self._cost, profile.candidates
        seeing: Sequence[int] = cost.seeing
        count, rated = len(seeing), len(normals) // candidates
        ends = [candidates * (rated * part // count) for part in range(count + 1)]
        proposed = [
            propose_arms(
                cost.to_views[number](pool),
                arm,
                profile,
                cost.costs[number],
                (normals[begin:end], uniforms[begin:end]),
                count,
            )
            for number, begin, end in zip(seeing, ends, ends[1:], strict=False)
        ]
        arms = proposed[0] if count == 1 else np.concatenate(proposed)
        return self.promising(arms, arm, candidates)

    def promising(self, arms: FloatArray, arm: int, candidates: int) -> FloatArray:
        """Return the arm with the least approximate cost of each ``candidates`` arms (N, 4)."""
        if candidates == 1:
            return arms
        # Neighbouring arms are of one kind of proposal, so all kinds remain.
        costs = self._cost.arms_by_points(arms, arm)
        best: FloatArray = arm_proposals.best_of_each(arms, costs, candidates)
        return best
