"""State of each keypoint: whether it can be relied upon, and whether a camera sees it.

A keypoint is wrong if it is off by more than 30 cm. The learned corrector gives the probability of
this. Without it, each angle and place is taken to have a normal distribution with its standard
deviation, and the keypoint's error to lie along one line.
"""

from __future__ import annotations

from math import erfc, sqrt

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.keypoint_state import KeypointState
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.body_outline import TRUNK_PATCHES
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.correction import FAR_M

BoolArray = NDArray[np.bool_]

UNCERTAIN_FROM = 0.15
"""Probability of being wrong above which a keypoint is uncertain."""
LOST_FROM = 0.5
"""Probability of being wrong above which a keypoint is lost: it is rather wrong than right."""
SHARE_OF_CAMERAS, SHARE_OF_POINTS = 0.5, 0.7
"""Shares of the filter's deviations, which are those of one camera's outline, that keypoints have
with several cameras that look from different directions, and with points of a detector."""
BEHIND_M = 0.08
"""Distance behind the middle plane of the trunk from which the trunk hides a keypoint, m."""
HANDS = [2, 5]
"""Indices of the hands among the keypoints."""
_SHOULDERS, _LIMBS = [0, 3], [1, 2, 4, 5]
# Step of the numerical derivatives, rad and m.
_STEP = 1e-3
_NEAREST_M = 1e-3


def judged(
    cost: MultiViewCost,
    state: FloatArray,
    stddev: FloatArray,
    learned: FloatArray | None,
    is_doubtful: bool,
) -> tuple[FloatArray, tuple[KeypointState, ...]]:
    """Return probabilities (6,) and states of the keypoints of a result.

    Args:
        cost: of all cameras.
        state: the result, (14,), rad and m.
        stddev: its standard deviations, (14,).
        learned: the corrector's probabilities, (6,); None for those by the standard deviations.
        is_doubtful: whether the points of a detector cast doubt on the result.
    """
    chances = learned
    if chances is None:
        share = SHARE_OF_POINTS if len(cost.seeing) == 1 else SHARE_OF_CAMERAS
        chances = chances_by_spread(cost.costs[0], state, share * stddev)
    return chances, states_of(chances, are_hidden(cost, state), is_doubtful)


def chances_by_spread(cost: WholeBodyCost, state: FloatArray, stddev: FloatArray) -> FloatArray:
    """Return the probabilities (6,) that keypoints are wrong, from standard deviations.

    The covariance of a keypoint follows from the derivatives by the independent elements of the
    state; its trace is the variance s^2 along the line of the error, so that the probability of an
    error beyond r is erfc(r / (s sqrt 2)).

    Args:
        cost: has the kinematics of the body.
        state: state (14,), rad and m.
        stddev: its standard deviations, (14,).
    """
    middle_m = cost.keypoints(state)
    variances_m2 = np.zeros(len(middle_m))
    for number in np.flatnonzero(stddev):
        moved = state.copy()
        moved[number] += _STEP
        slopes = (cost.keypoints(moved) - middle_m) / _STEP
        variances_m2 += np.sum(slopes * slopes, axis=1) * stddev[number] ** 2
    return np.array([_beyond(sqrt(one)) for one in variances_m2])


def _beyond(deviation_m: float) -> float:
    return erfc(FAR_M / (deviation_m * sqrt(2.0))) if deviation_m > 0.0 else 0.0


def are_hidden(cost: MultiViewCost, state: FloatArray) -> BoolArray:
    """Return which keypoints (6,) of a state (14,) no camera sees that sees the person.

    A keypoint is hidden outside of the image and behind the trunk; shoulders are part of the trunk.
    """
    hidden = np.ones(6, dtype=np.bool_)
    for number in cost.seeing:
        there = cost.to_views[number](state)
        hidden &= _are_hidden_before(cost.costs[number], there)
    return hidden


def _are_hidden_before(cost: WholeBodyCost, state: FloatArray) -> BoolArray:
    points_m, trunk_m = cost.keypoints(state), cost.corners(state)[:TRUNK_PATCHES]
    fx, fy, cx, cy = cost.view[:4]
    width, height = cost.size

    def projected(points: FloatArray) -> FloatArray:
        depth_m = np.maximum(points[..., 2], _NEAREST_M)
        both = fx * points[..., 0] / depth_m + cx, fy * points[..., 1] / depth_m + cy
        return np.stack(both, axis=-1)

    pixels = projected(points_m)
    outside = (points_m[:, 2] <= 0.0) | (pixels < 0.0).any(axis=1)
    outside |= (pixels[:, 0] >= width) | (pixels[:, 1] >= height)
    # A point is in a convex patch if it is on the same side of all edges.
    corners = projected(trunk_m)
    edges = np.roll(corners, -1, axis=1) - corners
    away = pixels[:, None, None] - corners
    sides = edges[..., 0] * away[..., 1] - edges[..., 1] * away[..., 0]
    in_patch = (sides >= 0.0).all(axis=2) | (sides <= 0.0).all(axis=2)
    # Depth of each patch's plane on the line of sight of each point.
    normals = np.cross(trunk_m[:, 1] - trunk_m[:, 0], trunk_m[:, 3] - trunk_m[:, 0])
    along = points_m @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        plane_m = points_m[:, 2:] * np.sum(normals * trunk_m[:, 0], axis=1) / along
    behind = (in_patch & (points_m[:, 2:] > plane_m + BEHIND_M)).any(axis=1)
    behind[_SHOULDERS] = False
    found: BoolArray = outside | behind
    return found


def are_sure(chances: FloatArray) -> bool:
    """Return whether no keypoint is uncertain by its probability of being wrong, (n,)."""
    return bool((chances <= UNCERTAIN_FROM).all())


def states_of(
    chances: FloatArray, hidden: BoolArray, is_doubtful: bool = False
) -> tuple[KeypointState, ...]:
    """Return the state of each keypoint from its probability of being wrong.

    Args:
        chances: probabilities, (6,).
        hidden: whether no camera sees the keypoint, (6,).
        is_doubtful: whether the points of a detector make elbows and hands uncertain at least.
    """
    if is_doubtful:
        chances = chances.copy()
        chances[_LIMBS] = np.maximum(chances[_LIMBS], np.nextafter(UNCERTAIN_FROM, 1.0))
    return tuple(
        _state_of(chance, is_hidden)
        for chance, is_hidden in zip(chances.tolist(), hidden.tolist(), strict=True)
    )


def _state_of(chance: float, is_hidden: bool) -> KeypointState:
    if is_hidden:
        return KeypointState.HIDDEN
    if chance > LOST_FROM:
        return KeypointState.LOST
    return KeypointState.UNCERTAIN if chance > UNCERTAIN_FROM else KeypointState.TRACKED
