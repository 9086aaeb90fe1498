"""Compiled selection and averages of rated states."""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.posture import N_STATE, PITCH, TORSO_X, TORSO_Y, YAW
from cardbox_tracker.terms.kernel_arguments import Floats

# Metres per radian of yaw or pitch in the distance between states.
_RADIAN_M = 0.3
Indices = NDArray[np.int64]


@kernel
def least_of(ratings: Floats, count: int) -> Indices:
    """Return the indices of the least ``count`` of ratings (N,), least first; all if N is less.

    Equal ratings keep their order, and those that are not numbers come last.
    """
    most = min(count, ratings.shape[0])
    chosen, values = np.empty(most, np.int64), np.empty(most)
    found = 0
    for i in range(ratings.shape[0]):
        value = ratings[i] if ratings[i] == ratings[i] else np.inf
        if found < most:
            found += 1
        elif most == 0 or not value < values[most - 1]:
            continue
        j = found - 1
        while j > 0 and value < values[j - 1]:
            chosen[j], values[j] = chosen[j - 1], values[j - 1]
            j -= 1
        chosen[j], values[j] = i, value
    return chosen


@kernel
def spread_of_arm(joints_m: Floats, ratings: Floats, spread: float) -> tuple[float, float]:
    """Return weighted deviations of elbow and hand, m, of arms with ``joints_m`` (N, 3, 3)."""
    best = np.inf
    for rating in ratings:
        if rating < best:
            best = rating
    total = 0.0
    sums, squares = np.zeros((3, 3)), np.zeros((3, 3))
    for i in range(joints_m.shape[0]):
        weight = exp((best - ratings[i]) / spread)
        if weight < 1e-4:
            continue
        total += weight
        for j in range(1, 3):
            for c in range(3):
                sums[j, c] += weight * joints_m[i, j, c]
                squares[j, c] += weight * joints_m[i, j, c] ** 2
    elbow, hand = 0.0, 0.0
    for c in range(3):
        elbow += max(squares[1, c] / total - (sums[1, c] / total) ** 2, 0.0)
        hand += max(squares[2, c] / total - (sums[2, c] / total) ** 2, 0.0)
    return sqrt(elbow), sqrt(hand)


@kernel
def choose_apart(
    states: Floats, ratings: Floats, joints_m: Floats, most: int, alike: int, apart_m: float
) -> Indices:
    """Return up to ``most`` indices: the best ``alike``, then the best that differ from all chosen.

    Two states (N, 14) differ if their Euclidean distance is at least ``apart_m``. It includes
    elbows and hands in the torso's frame, from ``joints_m`` (N, 6, 3), ``torso_x``, ``torso_y``,
    yaw and pitch, with a factor of 0.3 m per radian.
    """
    order = least_of(ratings, ratings.shape[0])
    chosen = np.empty(most, np.int64)
    features, one = np.empty((most, 16)), np.empty(16)
    found = 0
    for i in order:
        state = states[i]
        for arm in range(2):
            for c in range(3):
                one[6 * arm + c] = joints_m[i, 3 * arm + 1, c]
                one[6 * arm + 3 + c] = joints_m[i, 3 * arm + 2, c]
        one[12], one[13] = state[TORSO_X], state[TORSO_Y]
        one[14], one[15] = _RADIAN_M * state[YAW], _RADIAN_M * state[PITCH]
        is_new = True
        if found >= alike:
            for j in range(found):
                squares = 0.0
                # Few tests, which are hard to predict.
                for c in range(0, 16, 4):
                    for d in range(c, c + 4):
                        squares += (features[j, d] - one[d]) ** 2
                    if squares >= apart_m * apart_m:
                        break
                if squares < apart_m * apart_m:
                    is_new = False
                    break
        if is_new:
            for c in range(16):
                features[found, c] = one[c]
            chosen[found] = i
            found += 1
            if found == most:
                break
    return chosen[:found]


@kernel
def best_states(states: Floats, ratings: Floats, count: int) -> Floats:
    """Return the best ``count`` of ``states`` (N, 14), best first."""
    order = least_of(ratings, count)
    best = np.empty((count, N_STATE))
    for i in range(count):
        for d in range(N_STATE):
            best[i, d] = states[order[i], d]
    return best


@kernel
def mean_and_spread(
    states: Floats, ratings: Floats, count: int, spread: float
) -> tuple[Floats, Floats]:
    """Return the mean (14,) of the best ``count`` states, and deviations (14,) of all around it.

    The weights of the states (N, 14) are exp(-(rating - best) / ``spread``).
    """
    order = least_of(ratings, count)
    best = ratings[order[0]]
    mean, squares = np.zeros(N_STATE), np.zeros(N_STATE)
    total = 0.0
    for i in range(min(count, order.shape[0])):
        weight = exp((best - ratings[order[i]]) / spread)
        total += weight
        for d in range(N_STATE):
            mean[d] += weight * states[order[i], d]
    for d in range(N_STATE):
        mean[d] /= total
    total = 0.0
    for i in range(states.shape[0]):
        weight = exp((best - ratings[i]) / spread)
        total += weight
        for d in range(N_STATE):
            squares[d] += weight * (states[i, d] - mean[d]) ** 2
    return mean, np.sqrt(squares / total)
