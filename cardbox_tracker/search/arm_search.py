"""The whole-body filter's search of one arm beside a fixed torso."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from cardbox_tracker.person.kinematics import angles_of_arms
from cardbox_tracker.person.posture import JOINT_LIMITS, LEFT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import arm_proposals, state_choice
from cardbox_tracker.search.rated_states import Draws
from cardbox_tracker.search.whole_body_config import SearchProfile
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.pose_prior import sample_bank
from cardbox_tracker.terms.whole_body import WholeBodyCost

ARM_LIMITS = np.ascontiguousarray(JOINT_LIMITS[LEFT_ARM])
"""Lowest and highest angles of an arm, (4, 2), rad."""


@cache
def bank_of_arms() -> FloatArray:
    """Return angles (3000, 4), rad, of an arm; they serve for both sides."""
    arms: FloatArray = angles_of_arms(sample_bank(), 1.0, ARM_LIMITS)
    arms.setflags(write=False)
    return arms


def propose_arms(
    pool: FloatArray,
    arm: int,
    config: SearchProfile,
    cost: WholeBodyCost,
    numbers: tuple[FloatArray, FloatArray],
    share: int = 1,
) -> FloatArray:
    """Return arms (N, 4), 0 left or 1 right, for the torso of the first state of a pool.

    The states ``pool`` (M, 14) are before the camera of ``cost``, whose torso is fixed, the best
    first. ``numbers`` are unit normal (N, 4) and uniform in 0..1 (N, 3); ``share`` is the number of
    cameras, by which the numbers of ``config`` are divided.
    """
    # With several cameras, rounding may leave fewer arms than these kinds need together.
    left = len(numbers[0]) - 1
    mirrors = min(config.arm_mirrors // share, left)
    tips = min(config.arm_tips // share, left - mirrors)
    banked = min(config.banked_arms // share, left - mirrors - tips)
    kinds = config.survivors, config.arm_noise_rad, mirrors, tips, banked
    plan = *kinds, bank_of_arms(), ARM_LIMITS
    seen = cost.uncovered(arm), cost.counted
    return arm_proposals.propose_arms(pool, arm, plan, *seen, cost.body, numbers)


# Noise around the best arms, as a fraction of the usual noise.
_AGAIN_NOISE = 0.45


class ArmSearch:
    """Searches arms (N, 4) beside a cost's torso; ``spreads_m`` are those of elbows and hands."""

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
        """Return arms (N, 4) with this torso of ``pool`` (M, 14), best first, and ratings (N,)."""
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
        """Return arms (N, 4), an equal part by each camera that shows the person."""
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
