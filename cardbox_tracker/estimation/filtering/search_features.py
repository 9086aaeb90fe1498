"""Features of the search of a frame for the learned corrector.

The spread of elbows and hands over the rated states indicates other postures that fit nearly as
well; the evidence of :mod:`.loss` measures the fit of the best posture.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.filtering.loss import Evidence, freshness, log_area

# Least relative weight of a state that counts.
_LEAST_WEIGHT = 1e-4
# Indices of left elbow and hand, right elbow and hand in the keypoints; then of the shoulders.
_MOVING = np.array([1, 2, 4, 5])
_LEFT, _RIGHT = 0, 3
# First columns: means and deviations of elbows and hands, then of the middle of the shoulders.
MEANS, DEVIATIONS = 0, 3 * len(_MOVING)
MIDDLE_MEAN, MIDDLE_DEVIATION = 2 * DEVIATIONS, 2 * DEVIATIONS + 3
# Columns of the evidence of loss.
OF_EVIDENCE = slice(MIDDLE_DEVIATION + 3, MIDDLE_DEVIATION + 11)
SEARCH_FEATURES = OF_EVIDENCE.stop
"""Number of features of an arm from :func:`features_of_search`."""


class Search(NamedTuple):
    """The result of the search of a frame.

    Attributes:
        states: rated states, (N, 14).
        ratings: ratings of the states, (N,); each state has the weight exp(-rating / ``spread``).
        keypoints_m: keypoints of the states in the optical frame, (N, 6, 3), metres.
        spread: difference of ratings that changes a weight by the factor e.
        evidence: evidence for or against the mean state.
        chance: probability of loss, see :mod:`.loss`.
    """

    states: FloatArray
    ratings: FloatArray
    keypoints_m: FloatArray
    spread: float
    evidence: Evidence
    chance: float


def features_of_search(search: Search, result_m: FloatArray) -> FloatArray:
    """Return the features (2, F) for the left arm and the mirrored right arm.

    For elbow and hand of the arm, then of the other arm, relative to the middle of the shoulders,
    they are the mean over the states minus the result, and the deviations, metres.

    Args:
        search: result of the search.
        result_m: keypoints of the result, (6, 3), metres in the optical frame.
    """
    features = np.empty((2, SEARCH_FEATURES))
    _fill(search.keypoints_m, search.ratings, search.spread, result_m, features)
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


@kernel
def _fill(keypoints_m: Any, ratings: Any, spread: float, result_m: Any, features: Any) -> None:
    """Write means and deviations of :func:`features_of_search` to ``features`` (2, F)."""
    count = len(_MOVING)
    sums, squares = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    seen, total, best = np.empty((count + 1, 3)), 0.0, ratings.min()
    for n in range(len(ratings)):
        weight = exp((best - ratings[n]) / spread)
        if weight < _LEAST_WEIGHT:
            continue
        total += weight
        _beside_middle(keypoints_m[n], seen)
        for j in range(count + 1):
            for axis in range(3):
                sums[j, axis] += weight * seen[j, axis]
                squares[j, axis] += weight * seen[j, axis] * seen[j, axis]
    _beside_middle(result_m, seen)
    for arm in range(2):
        for j in range(count + 1):
            # The row's own arm comes first, and the middle of the shoulders last.
            source = j if j == count or arm == 0 else (j + 2) % count
            of_mean = MIDDLE_MEAN if j == count else MEANS + 3 * j
            of_deviation = MIDDLE_DEVIATION if j == count else DEVIATIONS + 3 * j
            for axis in range(3):
                mean = sums[source, axis] / total
                variance = squares[source, axis] / total - mean * mean
                sign = -1.0 if arm == 1 and axis == 0 else 1.0
                features[arm, of_mean + axis] = sign * (mean - seen[source, axis])
                features[arm, of_deviation + axis] = sqrt(max(variance, 0.0))


@kernel
def _beside_middle(points: Any, seen: Any) -> None:
    """Write elbows and hands relative to mid-shoulder, then mid-shoulder, to ``seen`` (5, 3)."""
    for axis in range(3):
        middle = 0.5 * (points[_LEFT, axis] + points[_RIGHT, axis])
        for j in range(len(_MOVING)):
            seen[j, axis] = points[_MOVING[j], axis] - middle
        seen[len(_MOVING), axis] = middle
