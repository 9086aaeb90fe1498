"""Features of the search of a frame for the learned corrector.

Where the rated states have their elbows and hands says which other postures explain the silhouette
nearly as well, and the evidence of loss says how well the best one does.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kinematics import keypoints
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.loss import Evidence, freshness, log_area

# States that weigh less than this, beside 1 of the best, do not count.
_LEAST_WEIGHT = 1e-4
# Left elbow and hand, right elbow and hand among the keypoints; shoulders.
_MOVING = np.array([1, 2, 4, 5])
_LEFT, _RIGHT = 0, 3
# First columns: means and deviations of elbows and hands, then of the middle of the shoulders.
MEANS, DEVIATIONS = 0, 3 * len(_MOVING)
MIDDLE_MEAN, MIDDLE_DEVIATION = 2 * DEVIATIONS, 2 * DEVIATIONS + 3
# Columns of the evidence of loss.
OF_EVIDENCE = slice(MIDDLE_DEVIATION + 3, MIDDLE_DEVIATION + 11)
SEARCH_FEATURES = OF_EVIDENCE.stop
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
    features[:, OF_EVIDENCE] = (
        seen.residual,
        seen.left_over,
        seen.outside,
        log_area(seen),
        seen.prior,
        seen.arm_m,
        freshness(seen),
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
            of_mean = MIDDLE_MEAN if j == count else MEANS + 3 * j
            of_deviation = MIDDLE_DEVIATION if j == count else DEVIATIONS + 3 * j
            for axis in range(3):
                mean = sums[source, axis] / total
                variance = squares[source, axis] / total - mean * mean
                sign = -1.0 if arm == 1 and axis == 0 else 1.0
                features[arm, of_mean + axis] = sign * (mean - seen[source, axis])
                features[arm, of_deviation + axis] = sqrt(max(variance, 0.0))


@njit(cache=True, nogil=True, error_model="numpy")
def _beside_middle(points: Any, seen: Any) -> None:
    """Write elbows and hands beside the shoulders' middle, then the middle, to ``seen`` (5, 3)."""
    for axis in range(3):
        middle = 0.5 * (points[_LEFT, axis] + points[_RIGHT, axis])
        for j in range(len(_MOVING)):
            seen[j, axis] = points[_MOVING[j], axis] - middle
        seen[len(_MOVING), axis] = middle
