"""Compiled priors of the whole body; their unit is a squared normalized distance."""

from __future__ import annotations

from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.compiling import borrowing_kernel, inlined_kernel, kernel
from cardbox_tracker.person.kinematics import PosedArm, angles_in, new_arm, pose_arm, side_of
from cardbox_tracker.person.parts import (
    BOTTOM,
    BOTTOM_WIDTH,
    DEPTH,
    FOREARM,
    FORWARD,
    HEAD,
    HEIGHT,
    TOP_WIDTH,
    TORSO,
    WAIST,
)
from cardbox_tracker.person.posture import PITCH, ROLL, TORSO_X, TORSO_Z, YAW
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of
from cardbox_tracker.terms.pose_prior import nats_of
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

# Values of ``rules`` (14,); ``WholeBodyCostConfig`` describes them.
(
    WEIGHT,
    ROLL_UNIT,
    FORWARD_UNIT,
    BACK_UNIT,
    YAW_UNIT,
    ANGLE_CAP,
    X_STEP,
    Z_STEP,
    STEP_CAP,
    X_HOME,
    Z_HOME,
    HOME_CAP,
    PENETRATION,
    UNKNOWN_DENSITY,
) = range(14)

# The body ends this far below mid-hip, m, so that a hanging arm is not inside the legs.
_HIPS_END_M = -0.1


class Prior(NamedTuple):
    """The priors of one frame."""

    #: x and z of the last frame, the home of x, metres, and expected yaw and lean, rad; (5,).
    anchor: Floats
    rules: Floats  #: units and weights, (14,)
    gaussians: Floats  #: mixture of an arm's directions, (28, K), see :func:`.pose_prior.nats_of`


PriorTuple = tuple[Floats, Floats, Floats]


@inlined_kernel
def _saturating(square: float, cap: float) -> float:
    """Return about ``square`` for small values, and at most ``cap``."""
    return cap * (1.0 - exp(-square / cap))


@inlined_kernel
def torso_prior(state: Floats, given: Prior) -> float:
    """Return the prior of the torso of a state (14,)."""
    anchor, rules = given.anchor, given.rules
    # The priors count for the first camera only.
    if rules[WEIGHT] == 0.0:
        return 0.0
    cap = rules[ANGLE_CAP]
    pitch = state[PITCH] - anchor[4]
    pitch /= rules[BACK_UNIT] if pitch < 0.0 else rules[FORWARD_UNIT]
    rated = _saturating((state[ROLL] / rules[ROLL_UNIT]) ** 2, cap)
    rated += _saturating(pitch**2, cap)
    rated += _saturating(((state[YAW] - anchor[3]) / rules[YAW_UNIT]) ** 2, cap)
    rated += _saturating(((state[TORSO_X] - anchor[0]) / rules[X_STEP]) ** 2, rules[STEP_CAP])
    rated += _saturating(((state[TORSO_Z] - anchor[1]) / rules[Z_STEP]) ** 2, rules[STEP_CAP])
    rated += _saturating(((state[TORSO_X] - anchor[2]) / rules[X_HOME]) ** 2, rules[HOME_CAP])
    rated += _saturating((state[TORSO_Z] / rules[Z_HOME]) ** 2, rules[HOME_CAP])
    prior: float = rules[WEIGHT] * rated
    return prior


@inlined_kernel
def _depth_inside(x: float, y: float, z: float, parts: Floats, margin: float) -> float:
    """Return the depth of a point inside trunk or head: 0 outside, up to 1 on the axis.

    The point is in the torso's frame. The trunk is an elliptic frustum and the head an ellipsoid,
    both widened by ``margin``, metres.
    """
    waist_top = parts[TORSO, BOTTOM]
    top = waist_top + parts[TORSO, HEIGHT]
    deep = 0.0
    if _HIPS_END_M < z < top:
        if z < waist_top:
            wide, thick = parts[WAIST, TOP_WIDTH] / 2, parts[WAIST, DEPTH] / 2
        else:
            along = (z - waist_top) / parts[TORSO, HEIGHT]
            below, above = parts[TORSO, BOTTOM_WIDTH], parts[TORSO, TOP_WIDTH]
            wide, thick = (below + (above - below) * along) / 2, parts[TORSO, DEPTH] / 2
        a, b = x / (thick + margin), y / (wide + margin)
        deep = max(1.0 - sqrt(a * a + b * b), 0.0)
    a = (x - parts[HEAD, FORWARD]) / (parts[HEAD, DEPTH] / 2 + margin)
    b = y / (parts[HEAD, TOP_WIDTH] / 2 + margin)
    half = parts[HEAD, HEIGHT] / 2
    c = (z - parts[HEAD, BOTTOM] - half) / (half + margin)
    return max(deep, 1.0 - sqrt(a * a + b * b + c * c))


@borrowing_kernel
def penetration(points: Floats, parts: Floats) -> float:
    """Return the sum of the depths of hand, mid-forearm and elbow (3, 3) inside trunk or head."""
    margin = parts[FOREARM, TOP_WIDTH] / 2
    elbow, hand = points[1], points[2]
    deep = _depth_inside(hand[0], hand[1], hand[2], parts, margin)
    x, y, z = (elbow[0] + hand[0]) / 2, (elbow[1] + hand[1]) / 2, (elbow[2] + hand[2]) / 2
    deep += _depth_inside(x, y, z, parts, margin)
    deep += _depth_inside(elbow[0], elbow[1], elbow[2], parts, 0.0)
    return deep


@inlined_kernel
def arm_prior(arm: PosedArm, side: float, parts: Floats, given: Prior, logs: Floats) -> float:
    """Return the prior of a posed arm: the learned prior, nats, and the cost of penetration.

    ``logs`` is scratch with one value for each Gaussian, (K,).
    """
    rules = given.rules
    if rules[WEIGHT] == 0.0:
        return 0.0
    for c in range(6):
        arm.outward[c] = arm.directions[c] * (side if c == 1 or c == 4 else 1.0)
    rated = nats_of(arm.outward, given.gaussians, rules[UNKNOWN_DENSITY], logs)
    rated += rules[PENETRATION] * penetration(arm.points, parts)
    prior: float = rules[WEIGHT] * rated
    return prior


@kernel
def priors(state: Floats, body: BodyTuple, prior: PriorTuple) -> tuple[float, float, float]:
    """Return the priors of torso, left and right arm of one state."""
    found = np.zeros(2)
    arm, of, given = new_arm(), body_of(body), Prior(*prior)
    logs = np.empty(given.gaussians.shape[1])
    for k in range(2):
        angles, side = angles_in(state, k), side_of(k)
        pose_arm(angles, side, of.parts, of.girdle, arm.points, arm.directions)
        found[k] = arm_prior(arm, side, of.parts, given, logs)
    return torso_prior(state, given), found[0], found[1]


def rules_of(config: WholeBodyCostConfig) -> Floats:
    """Return the values of ``rules``, (14,), from the settings."""
    rules = np.empty(UNKNOWN_DENSITY + 1)
    rules[WEIGHT] = config.weight
    rules[ROLL_UNIT] = np.radians(config.roll_deg)
    rules[FORWARD_UNIT] = np.radians(config.pitch_forward_deg)
    rules[BACK_UNIT] = np.radians(config.pitch_back_deg)
    rules[YAW_UNIT] = np.radians(config.yaw_deg)
    rules[ANGLE_CAP] = config.angle_cap
    rules[X_STEP], rules[Z_STEP] = config.x_step_m, config.z_step_m
    rules[STEP_CAP] = config.step_cap
    rules[X_HOME], rules[Z_HOME] = config.x_home_m, config.z_home_m
    rules[HOME_CAP] = config.home_cap
    rules[PENETRATION] = config.penetration
    rules[UNKNOWN_DENSITY] = np.exp(-config.unknown_nats)
    return rules
