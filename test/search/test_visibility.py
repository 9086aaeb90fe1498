"""Keypoints that no camera sees: outside of the image, and behind the trunk."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TORSO_Y, reference_posture
from cardbox_tracker.search.visibility import are_hidden
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.3)
FRONT = np.append(reference_posture("front"), [0.0, 0.0])


def cost_of(views: tuple[View, ...] = ()) -> MultiViewCost:
    cost = MultiViewCost(BODY, CAMERA, views, WholeBodyCostConfig())
    cost.choose(list(range(1 + len(views))))
    return cost


COST = cost_of()


def test_an_arm_outside_of_the_image_is_hidden() -> None:
    assert not are_hidden(COST, FRONT).any()
    aside = FRONT.copy()
    # Half of the image is 159.5 / 300 * 2.3 = 1.22 m wide at the person's distance.
    aside[TORSO_Y] = 1.2
    assert are_hidden(COST, aside).tolist() == [True] * 3 + [False] * 3


def test_a_hand_behind_the_trunk_is_hidden_and_one_before_it_is_not() -> None:
    behind, before = FRONT.copy(), FRONT.copy()
    behind[4:8] = np.radians([13.0, -60.0, -55.0, 17.0])
    before[4:8] = np.radians([-10.0, 40.0, -40.0, 40.0])
    for state, is_hidden in ((behind, True), (before, False)):
        hand, shoulder = COST.costs[0].keypoints(state)[[2, 0]]
        assert (hand[2] > shoulder[2]) == is_hidden and abs(hand[0]) < 0.15
        assert are_hidden(COST, state).tolist() == [False, False, is_hidden, *[False] * 3]
    # A camera on the left of the person sees the hand behind the back.
    turned = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    centre = np.array([0.0, 0.0, 2.3])
    beside = OtherCamera(CAMERA, Extrinsics(turned, centre - turned @ centre))
    both = cost_of((View.of(BODY, CAMERA, beside),))
    assert not are_hidden(both, behind).any()
    # Unless it does not see the person.
    both.choose([0])
    assert are_hidden(both, behind).tolist() == [False, False, True, *[False] * 3]
