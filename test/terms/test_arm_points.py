"""Arms rated at points along their bones: by hand, and beside what drawing them says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import angles_of_arms
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

BODY = BodyModel.of(hip_height_m=-0.4)
CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
ASIDE = np.array([np.pi / 2, 0.0, 0.0, 0.0])


def cost_of(silhouette: FloatArray) -> WholeBodyCost:
    """The cost that sees a silhouette, its torso fixed upright."""
    cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig(weight=0.0))
    cost.see(silhouette, FRONT)
    cost.fix_torso(FRONT)
    return cost


def about_of(cost: WholeBodyCost, arms: FloatArray) -> FloatArray:
    return cost.arms_by_points(arms, cost.joints(arms, 0), 0)


def everywhere(value: int) -> FloatArray:
    return np.full((CAMERA.height, CAMERA.width), value, np.uint8)


def test_an_arm_stretched_aside_by_hand() -> None:
    """Two bars across the line of sight, half a square longer each, at the hips' distance."""
    cost = cost_of(everywhere(255))
    size, px_per_m = BODY.size, CAMERA.fx / BODY.placement.distance_m
    expected_px = 0.0
    for wide, long_m in (
        ("upper_arm_width", size("upper_arm_length")),
        ("forearm_width", size("forearm_length") + WholeBodyCostConfig().fingers_m),
    ):
        expected_px += size(wide) * (long_m + 0.5 * size(wide)) * px_per_m**2
    found_px = about_of(cost, ASIDE[None])[0] * cost.silhouette_px
    assert found_px == pytest.approx(-expected_px, rel=0.02)


def test_of_background_it_costs_what_of_foreground_it_gains() -> None:
    covered = cost_of(everywhere(255))
    silhouette = everywhere(255)
    # The left arm is on the right of the image.
    silhouette[:, 95:] = 0
    mixed = cost_of(silhouette)
    gain = about_of(covered, ASIDE[None])[0] * covered.silhouette_px
    assert about_of(mixed, ASIDE[None])[0] * mixed.silhouette_px == pytest.approx(-gain)


def test_before_the_trunk_and_beyond_the_image_it_costs_nothing() -> None:
    """The upper arm hangs; the forearm points aside, or back before the trunk."""
    cost = cost_of(everywhere(255))
    directions = np.array([(0.0, 0.0, -1.0, 0.0, y, 0.0) for y in (1.0, -1.0)])
    outwards, inwards = about_of(cost, angles_of_arms(directions, 1.0, ARM_LIMITS))
    size, px_per_m = BODY.size, CAMERA.fx / BODY.placement.distance_m
    long_m = size("forearm_length") + WholeBodyCostConfig().fingers_m + 0.5 * size("forearm_width")
    forearm_px = size("forearm_width") * long_m * px_per_m**2
    assert (inwards - outwards) * cost.silhouette_px == pytest.approx(forearm_px, rel=0.3)
    away = FRONT.copy()
    away[0] = 5.0
    cost.fix_torso(away)
    assert about_of(cost, ASIDE[None])[0] == 0.0


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_they_order_arms_much_as_drawn_ones_do(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low, high = ARM_LIMITS.T
    arms = low + (high - low) * rng.random((200, 4))
    silhouette = everywhere(0)
    state = FRONT.copy()
    state[4:8] = arms[0]
    cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig(weight=0.0))
    for patch in cost.corners(state):
        u, v = np.round(CAMERA.project(patch)).astype(int).T
        silhouette[max(v.min(), 0) : max(v.max(), 0), max(u.min(), 0) : max(u.max(), 0)] = 255
    cost.see(silhouette, state)
    cost.fix_torso(state)
    about, drawn = about_of(cost, arms), cost.arms(arms, 0)[0]
    assert np.corrcoef(np.argsort(np.argsort(about)), np.argsort(np.argsort(drawn)))[0, 1] > 0.7
