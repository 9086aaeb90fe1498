"""The neck's angles turn the head about the middle of the neck."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.neck import gaze_m, head_from_pivot_m, neck_pivot_m, neck_rotation
from cardbox_tracker.body.parts import body_parts

BODY = BodyModel.of(hip_height_m=-0.5)
PARTS = body_parts(BODY.sizes)


def test_yaw_turns_left_and_pitch_lowers_the_face() -> None:
    left, down = neck_rotation(np.array([np.pi / 2, 0.0])), neck_rotation(np.array([0.0, 0.4]))
    np.testing.assert_allclose(left[:, 0], (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(down[:, 0], (np.cos(0.4), 0.0, -np.sin(0.4)), atol=1e-12)


def test_the_head_of_a_neck_at_rest_is_the_models() -> None:
    middle = np.add(neck_pivot_m(PARTS), head_from_pivot_m(PARTS))
    np.testing.assert_allclose(middle, (PARTS.head.forward_m, 0.0, PARTS.head.middle_m))


@pytest.mark.parametrize("turn_rad", [0.0, 0.5])
def test_the_gaze_starts_in_the_head_and_turns_with_the_torso(turn_rad: float) -> None:
    posture = np.zeros(12)
    posture[3] = turn_rad
    frames = forward_kinematics(BODY, posture)
    start, end = gaze_m(PARTS, frames, np.zeros(2))
    np.testing.assert_allclose(start, frames.head, atol=1e-12)
    direction = (np.cos(turn_rad), np.sin(turn_rad), 0.0)
    np.testing.assert_allclose((end - start) / PARTS.head.height_m, direction, atol=1e-12)
