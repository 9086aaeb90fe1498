"""States of keypoints: how likely they are wrong, and whether a camera sees them."""

from __future__ import annotations

from math import erfc, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import TORSO_X, TORSO_Y, reference_posture
from cardbox_tracker.body.skeleton import KeypointState
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.keypoint_states import (
    chances_by_spread,
    states_of,
)
from cardbox_tracker.estimation.filtering.visibility import are_hidden
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.3)
FRONT = np.append(reference_posture("front"), [0.0, 0.0])


def cost_of(views: tuple[View, ...] = ()) -> MultiViewCost:
    cost = MultiViewCost(BODY, CAMERA, views, WholeBodyCostConfig())
    cost.choose(list(range(1 + len(views))))
    return cost


COST = cost_of()


def test_a_place_that_is_known_to_15_cm_is_wrong_in_one_of_22_images() -> None:
    stddev = np.zeros(14)
    stddev[TORSO_X] = 0.15
    # Beyond two deviations of a normal distribution: 4.55 %.
    assert chances_by_spread(COST.costs[0], FRONT, stddev) == pytest.approx([0.0455] * 6, abs=1e-4)


def test_independent_deviations_add_as_squares() -> None:
    stddev = np.zeros(14)
    stddev[[TORSO_X, TORSO_Y]] = 0.3, 0.4
    expected = erfc(0.3 / (0.5 * sqrt(2.0)))
    assert chances_by_spread(COST.costs[0], FRONT, stddev) == pytest.approx([expected] * 6)
    assert not chances_by_spread(COST.costs[0], FRONT, np.zeros(14)).any()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 13))
def test_more_deviation_is_more_chance(seed: int, number: int) -> None:
    rng = np.random.default_rng(seed)
    state, stddev = FRONT + 0.2 * rng.standard_normal(14), rng.uniform(0.01, 0.3, 14)
    before = chances_by_spread(COST.costs[0], state, stddev)
    stddev[number] += 0.2
    after = chances_by_spread(COST.costs[0], state, stddev)
    assert (after >= before - 1e-9).all() and (after >= 0.0).all() and (after <= 1.0).all()


def test_hands_outside_of_the_image_and_behind_the_trunk_are_hidden() -> None:
    assert not are_hidden(COST, FRONT).any()
    aside = FRONT.copy()
    # Half of the image is 159.5 / 300 * 2.3 = 1.22 m wide at the person's distance.
    aside[TORSO_Y] = 1.2
    hidden = are_hidden(COST, aside)
    assert hidden[:3].all() != hidden[3:].all()


def test_a_hand_behind_the_trunk_is_hidden_and_one_before_it_is_not() -> None:
    behind, before = FRONT.copy(), FRONT.copy()
    behind[4:8] = np.radians([13.0, -60.0, -55.0, 17.0])
    before[4:8] = np.radians([-10.0, 40.0, -40.0, 40.0])
    for state, is_hidden in ((behind, True), (before, False)):
        hand, shoulder = COST.keypoints(state)[[2, 0]]
        assert (hand[2] > shoulder[2]) == is_hidden and abs(hand[0]) < 0.15
        assert are_hidden(COST, state).tolist() == [False, False, is_hidden, *[False] * 3]
    # A camera on the left of the person sees the hand behind the back.
    turned = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    centre = np.array([0.0, 0.0, 2.3])
    beside = OtherCamera(CAMERA, Extrinsics(turned, centre - turned @ centre))
    both = cost_of((View.of(BODY, CAMERA, beside),))
    assert not are_hidden(both, behind).any()


def test_states_follow_the_chances_unless_nobody_sees_the_keypoint() -> None:
    chances = np.array([0.0, 0.15, 0.16, 0.5, 0.51, 0.9])
    hidden = np.array([False, False, False, False, False, True])
    tracked, uncertain = KeypointState.TRACKED, KeypointState.UNCERTAIN
    expected = tracked, tracked, uncertain, uncertain, KeypointState.LOST, KeypointState.HIDDEN
    assert states_of(chances, hidden) == expected
    # Doubt about a detector's points does not concern shoulders, and nothing gets better by it.
    doubted = states_of(chances, hidden, is_doubtful=True)
    assert doubted == (tracked, uncertain, *expected[2:])
