"""What the correction sees of the search: where its states have their hands, and how they fit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.loss import Evidence
from cardbox_tracker.estimation.filtering.search_features import (
    SEARCH_FEATURES,
    Search,
    features_of_search,
)
from cardbox_tracker.vision.camera import Camera

COST = WholeBodyCost(
    BodyModel.of(distance_m=2.3),
    Camera(320, 240, 300.0, 300.0, 159.5, 119.5),
    WholeBodyCostConfig(),
)
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
OTHER_ARM = [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13]
MIRROR = np.array([-1, -1, 1, -1, *[1] * 10])


def search(states: np.ndarray, ratings: np.ndarray) -> Search:
    evidence = Evidence(0.1, 0.2, 0.3, 0.5, 0.05, 0.06, np.zeros(14), FRONT, 15)
    keypoints_m = COST.bodies(states).points.keypoints_m
    return Search(states, ratings, keypoints_m, 0.02, evidence, 0.7)


def places(points: np.ndarray) -> np.ndarray:
    """Elbows and hands beside the shoulders' middle, and the middle, (5, 3)."""
    middle = 0.5 * (points[0] + points[3])
    return np.vstack([points[[1, 2, 4, 5]] - middle, middle])


def test_means_and_deviations_of_the_places_are_weighted_by_fit() -> None:
    bent = FRONT.copy()
    bent[7] += 0.8
    there = [places(COST.keypoints(state)) for state in (FRONT, bent)]
    # A difference of 0.02 log(3) makes the second state a third as likely: 3/4 and 1/4.
    ratings = np.array([0.1, 0.1 + 0.02 * np.log(3.0)])
    result_m = COST.keypoints(FRONT)
    found = features_of_search(search(np.array([FRONT, bent]), ratings), result_m)
    assert found.shape == (2, SEARCH_FEATURES)
    shift = there[1] - there[0]
    mean, deviation = 0.25 * shift, np.sqrt(0.25 * 0.75) * np.abs(shift)
    left = [*mean[:4].ravel(), *deviation[:4].ravel(), *mean[4], *deviation[4]]
    assert np.allclose(found[0, :30], left, atol=1e-9)
    # The right arm does not move, and comes first in the other row.
    assert np.allclose(found[1, :6], 0.0) and np.allclose(
        found[1, 6:12].reshape(2, 3)[:, 1:], mean[:2, 1:]
    )


def test_the_evidence_follows() -> None:
    found = features_of_search(search(FRONT[None], np.zeros(1)), COST.keypoints(FRONT))
    expected = [0.1, 0.2, 0.3, np.log(0.5), 0.05, 0.06, np.exp(-1.0), 0.7]
    assert found[0, 30:] == pytest.approx(expected) and found[1, 30:] == pytest.approx(expected)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_right_arm_is_seen_as_a_left_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    states = FRONT + 0.2 * rng.standard_normal((20, 14))
    ratings = 0.05 * rng.random(20)
    result = states.mean(axis=0)
    found = features_of_search(search(states, ratings), COST.keypoints(result))
    other, result = MIRROR * states[:, OTHER_ARM], MIRROR * result[OTHER_ARM]
    there = features_of_search(search(other, ratings), COST.keypoints(result))
    assert np.allclose(found, there[::-1], atol=1e-9)
