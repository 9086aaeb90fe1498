"""What the learned correction sees of the search of a frame, beside its result.

Where the rated states have their elbows and hands says which other postures explain the silhouette
nearly as well, and the evidence of loss says how well the best one does.
"""

from __future__ import annotations

from math import exp, log, sqrt
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kinematics import keypoints
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.loss import AREA_LIMITS, FRESH_FRAMES, Evidence

# States that weigh less than this, beside 1 of the best, do not count.
_LEAST_WEIGHT = 1e-4
# Left elbow and hand, right elbow and hand among the keypoints; shoulders.
_MOVING = np.array([1, 2, 4, 5])
_LEFT, _RIGHT = 0, 3
# Means of elbows and hands, their deviations, and both of the shoulders' middle.
_PLACES = 2 * (3 * len(_MOVING) + 3)
SEARCH_FEATURES = _PLACES + 8
"""How many numbers :func:`features_of_search` returns for an arm."""


class Search(NamedTuple):
    """What the search of a frame has found.

    Attributes:
        states: that were rated, (N, 14).
        ratings: of them, (N,); each weighs exp(-rating / ``spread``).
        spread: difference of ratings that changes a weight by e.
        evidence: how well their mean fits.
        chance: that it is wrong, see :mod:`.loss`.
    """

    states: FloatArray
    ratings: FloatArray
    spread: float
    evidence: Evidence
    chance: float


def features_of_search(search: Search, cost: WholeBodyCost, result_m: FloatArray) -> FloatArray:
    """Return what a network sees, (2, F): for the left arm, and for the right one mirrored.

    Places are of elbow and hand of the arm, then of the other arm, beside the middle of the
    shoulders: their mean over the states beside the result, and their deviations, metres.

    Args:
        search: what was found.
        cost: that has rated it.
        result_m: keypoints of the result, (6, 3), metres in the optical frame.
    """
    features = np.empty((2, SEARCH_FEATURES))
    _fill(search.states, search.ratings, search.spread, result_m, cost.body, features)
    seen = search.evidence
    features[:, _PLACES:] = (
        seen.residual,
        seen.left_over,
        seen.outside,
        log(min(max(seen.area, AREA_LIMITS[0]), AREA_LIMITS[1])),
        seen.prior,
        seen.arm_m,
        exp(-seen.age / FRESH_FRAMES),
        search.chance,
    )
    return features


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    states: Any,
    ratings: Any,
    spread: float,
    result_m: Any,
    body: Any,
    features: Any,
) -> None:
    """Write the places of :func:`features_of_search` to ``features`` (2, F)."""
    count = len(_MOVING)
    sums, squares = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    points, seen, total, best = np.empty((6, 3)), np.empty((count + 1, 3)), 0.0, ratings.min()
    for n in range(len(states)):
        weight = exp((best - ratings[n]) / spread)
        if weight < _LEAST_WEIGHT:
            continue
        keypoints(states[n], body, points)
        total += weight
        _beside_middle(points, seen)
        for j in range(count + 1):
            for axis in range(3):
                sums[j, axis] += weight * seen[j, axis]
                squares[j, axis] += weight * seen[j, axis] * seen[j, axis]
    _beside_middle(result_m, seen)
    for arm in range(2):
        for j in range(count + 1):
            # The arm of the row first; the middle stays the last.
            source = j if j == count or arm == 0 else (j + 2) % count
            column = 6 * count if j == count else 3 * j
            after = 3 if j == count else 3 * count
            for axis in range(3):
                mean = sums[source, axis] / total
                variance = squares[source, axis] / total - mean * mean
                sign = -1.0 if arm == 1 and axis == 0 else 1.0
                features[arm, column + axis] = sign * (mean - seen[source, axis])
                features[arm, column + after + axis] = sqrt(max(variance, 0.0))


@njit(cache=True, nogil=True, error_model="numpy")
def _beside_middle(points: Any, seen: Any) -> None:
    """Write elbows and hands beside the shoulders' middle, then the middle, to ``seen`` (5, 3)."""
    for axis in range(3):
        middle = 0.5 * (points[_LEFT, axis] + points[_RIGHT, axis])
        for j in range(len(_MOVING)):
            seen[j, axis] = points[_MOVING[j], axis] - middle
        seen[len(_MOVING), axis] = middle
