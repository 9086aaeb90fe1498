"""Arm proposals of the whole-body filter for one camera."""

from __future__ import annotations

from functools import cache

import numpy as np

from cardbox_tracker.person.kinematics import angles_of_arms
from cardbox_tracker.person.posture import JOINT_LIMITS, LEFT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import arm_proposals
from cardbox_tracker.search.whole_body_config import SearchProfile
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
