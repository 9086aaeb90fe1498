"""Joint angles from keypoints undo the forward kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import JOINT_LIMITS
from lab.evaluation.angles import joint_angles, limb_angles

BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4)


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.2, -0.3]))
def test_angles_come_back(seed: int, pitch_rad: float) -> None:
    rng = np.random.default_rng(seed)
    low, high = JOINT_LIMITS.T.copy()
    # Beyond 90 degrees of flexion the same direction has other angles.
    flexions = [5, 7, 9, 11]
    low[flexions], high[flexions] = -1.0, 1.5
    postures = rng.uniform(low, high, (4, 12))
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad)
    points = camera.reference_to_optical(pose(BODY.rigid, postures).keypoints_m)
    found = joint_angles(points, postures[:, 1:4], pitch_rad)
    np.testing.assert_allclose(found, postures[:, 1:], atol=1e-9)


@pytest.mark.parametrize(
    ("bone", "side", "abduction_deg", "flexion_deg"),
    [
        ((0, 0, -1), 1.0, 0, 0),  # hanging
        ((0, 1, 0), 1.0, 90, 0),  # to the left
        ((0, -3, 0), -1.0, 90, 0),  # the right arm to the right, of any length
        ((1, 0, 0), 1.0, 0, 90),  # forwards: the abduction is free
        ((np.sin(0.5), 0, -np.cos(0.5)), -1.0, 0, np.degrees(0.5)),
    ],
)
def test_limbs_by_hand(
    bone: tuple[float, ...], side: float, abduction_deg: float, flexion_deg: float
) -> None:
    abduction, flexion = limb_angles(np.array(bone, float), side)
    assert np.degrees(abduction) == pytest.approx(abduction_deg)
    assert np.degrees(flexion) == pytest.approx(flexion_deg)
