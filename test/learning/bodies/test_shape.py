from __future__ import annotations

import numpy as np
import pytest

from learning.bodies.proportions import proportions
from learning.bodies.rigged import RiggedBody
from learning.bodies.shape import Shape, draw_shape, reshaped


def test_the_neutral_shape_changes_nothing(stick: RiggedBody) -> None:
    same = reshaped(stick, Shape())
    assert same.vertices == pytest.approx(stick.vertices, abs=1e-6)
    assert same.joints == pytest.approx(stick.joints, abs=1e-6)
    assert proportions(stick)[:4] == pytest.approx((0.5, -0.02, 0.25, 0.375), abs=1e-5)


def test_the_shear_moves_the_shoulders_by_its_amount(stick: RiggedBody) -> None:
    sheared = reshaped(stick, Shape(forward_m=0.05))
    assert proportions(sheared).forward_m == pytest.approx(0.03, abs=1e-5)
    before, after = stick.in_t_pose(), sheared.in_t_pose()
    assert after.keypoints - before.keypoints == pytest.approx(
        np.tile([0.05, 0, 0], (6, 1)), abs=1e-5
    )
    assert after.hips == pytest.approx(before.hips, abs=1e-6)


def test_arms_and_breadth_follow_their_factors(stick: RiggedBody) -> None:
    body = reshaped(stick, Shape(upper_arm=1.1, forearm=0.9, hand=1.2, breadth=1.5, limbs=2.0))
    shoulder, elbow, hand = body.in_t_pose().keypoints[:3]
    assert shoulder[1] == pytest.approx(0.2 * 1.5, abs=1e-5)
    assert elbow[1] - shoulder[1] == pytest.approx(0.3 * 1.1, abs=1e-5)
    assert hand[1] - elbow[1] == pytest.approx(0.2 * 0.9 + 0.1 * 1.2, abs=1e-5)


def test_stature_and_legs(stick: RiggedBody) -> None:
    assert reshaped(stick, Shape(stature=1.1)).stature_m == pytest.approx(1.76, abs=1e-5)
    # Thighs and shins are 0.7 m of the legs' 0.8 m.
    assert reshaped(stick, Shape(legs=1.1)).leg_length_m == pytest.approx(0.87, abs=1e-5)


def test_drawn_shapes_stay_in_their_bounds(stick: RiggedBody) -> None:
    rng = np.random.default_rng(3)
    shares = []
    for _ in range(50):
        body = reshaped(stick, draw_shape(rng))
        found = proportions(body)
        shares.append(found.upper_arm)
        assert abs(found.forward_m + 0.02) < 0.06
        assert 1.4 < found.stature_m < 1.85
    assert 0.47 < min(shares) < 0.49 < 0.51 < max(shares) < 0.53
