"""The rest prior: its units by hand, and how it rates parts and wholes."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES, TORSO
from cardbox_tracker.estimation.cost.prior import RestPrior
from cardbox_tracker.estimation.cost.terms import ARMS, Frame
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(64, 48, 40.0, 40.0, 31.5, 23.5)
# 0.01 of 1000 foreground pixels: 10 px a squared unit.
FRAME = Frame(np.zeros((48, 64), np.uint8), 36, 1000)
SEEN = RestPrior(0.01).build(BodyModel(), CAMERA).observe(FRAME)


@pytest.mark.parametrize(
    ("joint", "angle_rad", "expected_px"),
    [
        ("torso_y", 1.0, 0.0),
        ("torso_roll", np.radians(20), 10.0),
        ("torso_roll", np.radians(-40), 40.0),
        ("torso_pitch", np.radians(26), 10.0),
        # Leaning back counts three times the angle.
        ("torso_pitch", np.radians(-13), 22.5),
        ("torso_yaw", np.radians(-20), 10.0),
        # Flexion in units of a sixth of its range, 150 and 105 degrees; abduction of the whole.
        ("left_shoulder_flexion", np.radians(25), 10.0),
        ("right_elbow_flexion", np.radians(35), 40.0),
        ("right_shoulder_abduction", np.radians(112.5), 2.5),
        ("left_elbow_abduction", np.radians(-150), 2.5),
    ],
)
def test_the_prior_by_hand(joint: str, angle_rad: float, expected_px: float) -> None:
    posture = np.zeros(12)
    posture[JOINT_NAMES.index(joint)] = angle_rad
    assert SEEN.postures(posture[None]).tolist() == pytest.approx([expected_px])
    part = joint.split("_")[0]
    if part == "torso":
        found = SEEN.torsos_beside(None)(posture[None, TORSO])
    else:
        found = SEEN.arms_beside(np.ones(4))(part, posture[None, ARMS[part]])
    assert found.tolist() == pytest.approx([expected_px])


def test_parts_add_up_to_the_whole() -> None:
    postures = np.random.default_rng(0).normal(0.0, 0.4, (30, 12))
    parts = SEEN.torsos_beside(postures[0])(postures[:, TORSO])
    rate_arms = SEEN.arms_beside(postures[0, TORSO])
    parts += sum(rate_arms(side, postures[:, joints]) for side, joints in ARMS.items())
    np.testing.assert_allclose(parts, SEEN.postures(postures))


def test_the_prior_leaves_the_particles_alone() -> None:
    particles = np.random.default_rng(0).normal(0.0, 0.4, (5, 4))
    before = particles.copy()
    SEEN.torsos_beside(None)(particles)
    np.testing.assert_array_equal(particles, before)


@pytest.mark.parametrize("weight", [-0.01, 1.5, float("nan")])
def test_a_weight_out_of_range_is_named(weight: float) -> None:
    with pytest.raises(ValueError, match=r"weight .*0 to 1"):
        RestPrior(weight)
