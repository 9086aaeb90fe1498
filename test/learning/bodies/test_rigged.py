from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from learning.bodies.rigged import INDEX, RiggedBody, strongest
from learning.segments import SEGMENTS

STILL = np.tile(np.eye(3, dtype=np.float32), (len(SEGMENTS), 1, 1))
STANDING = np.float32([0, 0, 1])
# A quarter turn about x, forward: from the left to down.
DOWN = np.float32([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
QUARTER_LEFT = np.float32([[0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_the_t_pose_has_level_arms(stick: RiggedBody) -> None:
    posed = stick.in_t_pose()
    arm = [[-0.02, 0.2, 1.3], [-0.02, 0.5, 1.3], [-0.02, 0.8, 1.3]]
    assert posed.keypoints[:3] == pytest.approx(np.array(arm), abs=1e-6)
    assert posed.keypoints[3:] == pytest.approx(np.array(arm) * [1, -1, 1], abs=1e-6)
    assert posed.hips == pytest.approx([0, 0, 0.8], abs=1e-6)
    assert posed.neck == pytest.approx([0, 0, 1.35], abs=1e-6)
    assert posed.head == pytest.approx([0, 0, 1.5], abs=1e-6)


def test_a_turned_arm_moves_its_keypoints_and_its_skin(stick: RiggedBody) -> None:
    turns = STILL.copy()
    for part in ("forearm", "hand"):
        turns[INDEX[f"left_{part}"]] = DOWN
    posed = stick.posed(turns, STANDING)
    assert posed.keypoints[0] == pytest.approx([-0.02, 0.2, 1.3], abs=1e-6)
    assert posed.keypoints[1] == pytest.approx([-0.02, 0.5, 1.3], abs=1e-6)
    assert posed.keypoints[2] == pytest.approx([-0.02, 0.5, 1.0], abs=1e-6)
    assert posed.vertices[3 * INDEX["left_hand"]] == pytest.approx([-0.02, 0.5, 1.1], abs=1e-6)


def test_a_turn_of_all_segments_is_rigid(stick: RiggedBody) -> None:
    before = stick.in_t_pose()
    after = stick.posed(STILL @ QUARTER_LEFT, np.float32([2, 1, 1]))
    shift = 0.8 * np.array([2, 1, 0])
    assert after.vertices == pytest.approx(before.vertices @ QUARTER_LEFT.T + shift, abs=1e-5)
    assert after.keypoints == pytest.approx(before.keypoints @ QUARTER_LEFT.T + shift, abs=1e-5)


def test_a_vertex_of_two_segments_goes_half_way(stick: RiggedBody) -> None:
    vertex = 3 * INDEX["left_forearm"] + 1
    weights = stick.weights
    weights[vertex] = 0
    weights[vertex, INDEX["left_upper_arm"]] = weights[vertex, INDEX["left_forearm"]] = 0.5
    bones, shares = strongest(weights)
    half = replace(stick, bones=bones, shares=shares)
    turns = STILL.copy()
    turns[INDEX["left_forearm"]] = QUARTER_LEFT
    moved = half.posed(turns, STANDING).vertices[vertex]
    # It lies 1 cm before the elbow, which the forearm turns to the left.
    assert moved == pytest.approx([-0.015, 0.505, 1.3], abs=1e-5)


def test_the_place_is_scaled_by_the_legs(stick: RiggedBody) -> None:
    assert stick.leg_length_m == pytest.approx(0.8, abs=1e-6)
    assert stick.stature_m == pytest.approx(1.6, abs=1e-6)
    tall = stick.scaled(1.25)
    assert (tall.leg_length_m, tall.stature_m) == pytest.approx((1.0, 2.0), abs=1e-6)
    assert tall.in_t_pose().vertices[:, 2].min() == pytest.approx(0, abs=1e-6)


def test_wrong_shapes_are_refused(stick: RiggedBody) -> None:
    with pytest.raises(ValueError, match=r"\(18, 3, 3\)"):
        stick.posed(STILL[:18], STANDING)


def test_the_strongest_four_sum_to_one() -> None:
    weights = np.zeros((1, len(SEGMENTS)))
    weights[0, [1, 3, 5, 7, 9]] = 0.3, 0.1, 0.4, 0.15, 0.05
    bones, shares = strongest(weights)
    assert bones.tolist() == [[5, 1, 7, 3]]
    assert shares[0] == pytest.approx(np.array([0.4, 0.3, 0.15, 0.1]) / 0.95)


def test_a_file_keeps_the_body(stick: RiggedBody, tmp_path: Path) -> None:
    stick.saved(tmp_path / "stick.npz")
    again = RiggedBody.loaded(tmp_path / "stick.npz")
    assert (again.name, again.family, again.sex) == ("stick", "test", "male")
    assert (again.in_t_pose().vertices == stick.in_t_pose().vertices).all()
