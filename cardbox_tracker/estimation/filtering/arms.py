"""Arms that the whole-body filter tries, before the camera whose silhouette they are tried for."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.posture import PLACE_LIMITS, TURNING_LIMITS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering import whole_body_moves as moves
from cardbox_tracker.estimation.filtering.arm_bank import bank_of_arms
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

STATE_LIMITS: FloatArray = np.vstack([TURNING_LIMITS, PLACE_LIMITS])
"""Of a state, shape (14, 2)."""

ARM_LIMITS = np.ascontiguousarray(STATE_LIMITS[4:8])
"""Of an arm, shape (4, 2)."""


def propose_arms(
    pool: FloatArray,
    arm: int,
    config: WholeBodyConfig,
    cost: WholeBodyCost,
    normals: FloatArray,
    uniforms: FloatArray,
    share: int = 1,
    times: int = 1,
) -> FloatArray:
    """Return arms (N, 4), 0 left or 1 right, for the torso of the first state of a pool.

    Args:
        pool: states (M, 14) as the camera of ``cost`` has them, the best first.
        arm: 0 left, 1 right.
        config: how many of each kind.
        cost: what one camera sees; its torso is fixed.
        normals: unit normal, (N, 4).
        uniforms: uniform in 0..1, (N, 3).
        share: of mirrored, reaching and likely arms, take only one in so many,
        times: and so many for each of them.
    """
    mirrors, tips, banked = (
        times * (count // share)
        for count in (config.arm_mirrors, config.arm_tips, config.banked_arms)
    )
    return moves.propose_arms(
        pool,
        arm,
        config.survivors,
        config.arm_noise_rad,
        mirrors,
        tips,
        bank_of_arms(),
        banked,
        cost.uncovered(arm),
        cost.parts,
        cost.girdle,
        cost.place,
        cost.view,
        ARM_LIMITS,
        normals,
        uniforms,
    )
