from __future__ import annotations

import numpy as np
import pytest

from learning.bodies.rigged import INDEX
from learning.bodies.t_pose import turns_to_t_pose, yaw_forward
from learning.segments import SEGMENTS


def test_palms_look_down_and_fingers_outward() -> None:
    joints = np.zeros((len(SEGMENTS), 3), np.float32)
    knuckles = np.zeros((2, 3), np.float32)
    for row, (side, out) in enumerate((("left", 1.0), ("right", -1.0))):
        joints[INDEX[f"{side}_shin"]] = (0, 0, -1)
        joints[INDEX[f"{side}_foot"]] = (0, 0, -2)
        joints[INDEX[f"{side}_forearm"]] = (0, 0.1 * out, -1)
        joints[INDEX[f"{side}_hand"]] = (0.5, 0.2 * out, -2)
        knuckles[row] = (0.6, 0.2 * out, -2.4)
    across = np.array([[-0.05, 0.01, 0], [-0.05, -0.01, 0]], np.float32)
    turns = turns_to_t_pose(joints, knuckles, across)
    assert turns @ turns.transpose(0, 2, 1) == pytest.approx(
        np.tile(np.eye(3), (19, 1, 1)), abs=1e-5
    )
    for row, (side, out) in enumerate((("left", 1.0), ("right", -1.0))):
        hand = INDEX[f"{side}_hand"]
        fingers = turns[hand] @ (knuckles[row] - joints[hand])
        assert fingers / np.linalg.norm(fingers) == pytest.approx([0, out, 0], abs=1e-5)
        little = turns[hand] @ across[row]
        assert little[0] < 0
        assert little[2] == pytest.approx(0, abs=1e-6)
        fore = turns[INDEX[f"{side}_forearm"]] @ (joints[hand] - joints[INDEX[f"{side}_forearm"]])
        assert fore / np.linalg.norm(fore) == pytest.approx([0, out, 0], abs=1e-5)


def test_a_foot_that_points_outward_is_turned_about_the_vertical() -> None:
    turn = yaw_forward(np.array([0.1, 0.1, 0.0]), np.array([0.0, 0.0, 0.1]))
    assert turn @ [0, 0, 1] == pytest.approx([0, 0, 1], abs=1e-6)
    assert turn @ [1, 1, 0] == pytest.approx([np.sqrt(2), 0, 0], abs=1e-6)
