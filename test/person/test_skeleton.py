"""The table of joints: names in their order, one tree, and right joints that mirror the left."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.skeleton import (
    FIXED,
    PRISMATIC,
    SKELETON,
    STATE_NAMES,
    UNITS,
    Group,
    joints_of,
)

JOINTS = {joint.name: joint for joint in SKELETON}
PARTS = body_parts(BodyModel().sizes)


def test_names_that_others_read_keep_their_order_and_new_ones_follow() -> None:
    assert STATE_NAMES[:16] == (
        *("torso_y", "torso_roll", "torso_pitch", "torso_yaw"),
        *("left_shoulder_abduction", "left_shoulder_flexion"),
        *("left_elbow_abduction", "left_elbow_flexion"),
        *("right_shoulder_abduction", "right_shoulder_flexion"),
        *("right_elbow_abduction", "right_elbow_flexion"),
        *("torso_x", "torso_z", "neck_yaw", "neck_pitch"),
    )
    assert STATE_NAMES[16:18] == ("left_clavicle_elevation", "right_clavicle_elevation")
    assert STATE_NAMES[18:] == (
        *("left_forearm_turn", "left_wrist_flexion", "left_wrist_deviation"),
        *("right_forearm_turn", "right_wrist_flexion", "right_wrist_deviation"),
        *("left_hip_flexion", "left_hip_abduction", "left_hip_rotation", "left_knee_flexion"),
        *("right_hip_flexion", "right_hip_abduction", "right_hip_rotation", "right_knee_flexion"),
    )
    movable = tuple(joint.name for joint in SKELETON if joint.kind != FIXED)
    assert movable == STATE_NAMES


def test_the_joints_form_one_tree_from_the_hips() -> None:
    assert len(JOINTS) == len(SKELETON)
    assert len({joint.link for joint in SKELETON}) == len(SKELETON)
    assert len({joint.rep155 for joint in SKELETON}) == len(SKELETON)
    for joint in SKELETON:
        chain = [joint]
        while chain[-1].parent:
            chain.append(JOINTS[chain[-1].parent])
            assert len(chain) <= len(SKELETON), f"{joint.name} carries itself"
        assert chain[-1].name == "torso_x"


@pytest.mark.parametrize("joint", SKELETON, ids=lambda joint: joint.name)
def test_axes_are_unit_vectors_and_limits_contain_rest(joint) -> None:  # type: ignore[no-untyped-def]
    assert np.linalg.norm(joint.axis) == pytest.approx(1.0)
    assert joint.limits[0] <= 0.0 <= joint.limits[1]
    assert UNITS[joint.name] == ("m" if joint.kind == PRISMATIC else "rad")


@pytest.mark.parametrize("group", Group)
def test_right_joints_mirror_left_ones(group: Group) -> None:
    for left in joints_of(group):
        if not left.name.startswith("left_"):
            continue
        right = JOINTS[left.name.replace("left_", "right_")]
        assert (right.limits, right.kind) == (left.limits, left.kind)
        assert right.parent == left.parent.replace("left_", "right_")
        flip = np.array([1.0, -1.0, 1.0])
        np.testing.assert_array_equal(right.offset(PARTS), flip * left.offset(PARTS))
        # A mirror turns rotations round.
        flip = flip if left.kind == PRISMATIC else -flip
        np.testing.assert_array_equal(right.axis, flip * left.axis)
