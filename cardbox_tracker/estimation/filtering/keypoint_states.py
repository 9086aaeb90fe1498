"""State of each keypoint: whether it can be relied upon.

A keypoint is wrong if it is off by more than 30 cm. The learned corrector gives the probability of
this. Without it, each angle and place is taken to have a normal distribution with its standard
deviation, and the keypoint's error to lie along one line.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import erfc, sqrt

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.kinematics import jacobian
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import KEYPOINT_NAMES, KeypointState
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.correction import FAR_M
from cardbox_tracker.estimation.filtering.visibility import are_hidden

BoolArray = NDArray[np.bool_]

UNCERTAIN_FROM = 0.15
"""Probability of being wrong above which a keypoint is uncertain."""
LOST_FROM = 0.5
"""Probability of being wrong above which a keypoint is lost: it is rather wrong than right."""
SHARE_OF_CAMERAS, SHARE_OF_POINTS = 0.5, 0.7
"""Shares of the filter's deviations, which are those of one camera's outline, that keypoints have
with several cameras that look from different directions, and with points of a detector."""
HANDS = [2, 5]
"""Indices of the hands among the keypoints."""
_LIMBS = [1, 2, 4, 5]


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
    by_state = jacobian(cost.person, state)[-len(KEYPOINT_NAMES) :]
    variances_m2 = (by_state**2).sum(axis=1) @ stddev**2
    least_m2 = np.finfo(np.float64).tiny
    return np.array([erfc(FAR_M / sqrt(2.0 * max(v, least_m2))) for v in variances_m2.tolist()])


def are_sure(chances: FloatArray) -> bool:
    """Return whether no keypoint is uncertain by its probability of being wrong, (n,)."""
    return all(chance <= UNCERTAIN_FROM for chance in chances.tolist())


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


def doubted(states: Sequence[KeypointState]) -> tuple[KeypointState, ...]:
    """Return the ``states`` of a result that is doubtful as a whole: nothing is tracked."""
    doubt = {KeypointState.TRACKED: KeypointState.UNCERTAIN}
    return tuple(doubt.get(state, state) for state in states)


def _state_of(chance: float, is_hidden: bool) -> KeypointState:
    if is_hidden:
        return KeypointState.HIDDEN
    if chance > LOST_FROM:
        return KeypointState.LOST
    return KeypointState.UNCERTAIN if chance > UNCERTAIN_FROM else KeypointState.TRACKED
