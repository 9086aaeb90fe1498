"""Sample of the learned prior of arms, from which the whole-body filter draws proposals."""

from __future__ import annotations

from functools import cache

import numpy as np

from cardbox_tracker.body.posture import JOINT_LIMITS, LEFT_ARM
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.kinematics import angles_of_arms
from cardbox_tracker.estimation.cost.pose_prior import sample_bank


@cache
def bank_of_arms() -> FloatArray:
    """Return angles (3000, 4) of arms, rad, which are valid for both sides."""
    limits = np.ascontiguousarray(JOINT_LIMITS[LEFT_ARM])
    arms: FloatArray = angles_of_arms(sample_bank(), 1.0, limits)
    arms.setflags(write=False)
    return arms
