"""The skeleton as another reader sees it: bones, places and gaps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.applications.exporting.bvh import write_bvh
from cardbox_tracker.applications.exporting.markers import markers_of
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import state_limits
from cardbox_tracker.person.skeleton import LEG_LIMITS

LIMBS = ("Arm", "ForeArm", "Hand")
JOINTS = [f"{side}{limb}" for side in ("Left", "Right") for limb in LIMBS]
# From the axes of the file, left, up and to the camera, into those of the laboratory.
TO_LABORATORY = np.array([(0, 0, 1), (0, 1, 0), (-1, 0, 0)])
LIMITS = state_limits(2.5)
shares = arrays(float, (3, 14), elements=st.floats(0, 1))


@given(share=shares, left=st.floats(0.0, 0.073), right=st.floats(0.0, 0.073))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_joints_are_where_the_table_has_them(
    share: np.ndarray,
    left: float,
    right: float,
    motion_of: Callable,
    joints_of_bvh: Callable,
    body: BodyModel,
    tmp_path: Path,
) -> None:
    states = LIMITS[:, 0] + share * (LIMITS[:, 1] - LIMITS[:, 0])
    motion = motion_of(states, body, (left, right))
    write_bvh(tmp_path / "a.bvh", motion, body)
    found = joints_of_bvh(tmp_path / "a.bvh")
    expected_m = markers_of(motion, body).points_m
    for number, name in enumerate(JOINTS):
        if name.endswith("Arm") and not name.endswith("ForeArm"):
            # A bone turns where the clavicle of the model is displaced along a line: the whole arm
            # is moved onto the circle of its shoulder.
            inner_m = found[name.replace("Arm", "Shoulder")] @ TO_LABORATORY.T
            along_m = expected_m[:, number] - inner_m
            radius_m = 0.43 * body.size("shoulder_breadth")
            share = radius_m / np.linalg.norm(along_m, axis=1, keepdims=True)
            moved_m = (share - 1.0) * along_m
            assert np.linalg.norm(moved_m, axis=1).max() < 3.1e-3
        there_m = expected_m[:, number] + moved_m
        assert found[name] @ TO_LABORATORY.T == pytest.approx(there_m, abs=1e-3)
    assert found["Hips"] @ TO_LABORATORY.T == pytest.approx(expected_m[:, 6], abs=1e-3)


def test_a_lifted_shoulder_does_not_turn_the_arm(
    motion_of: Callable, joints_of_bvh: Callable, body: BodyModel, tmp_path: Path
) -> None:
    write_bvh(tmp_path / "a.bvh", motion_of(np.zeros(14), body, (0.05, 0.03)), body)
    found = joints_of_bvh(tmp_path / "a.bvh")
    inner_m = (0.5 - 0.43) * body.size("shoulder_breadth")
    for side, sign, rise_m in (("Left", 1, 0.05), ("Right", -1, 0.03)):
        clavicle_m = 0.43 * body.size("shoulder_breadth")
        raised = found[f"{side}Arm"] - found[f"{side}Shoulder"]
        # The bone points to where the model has the shoulder.
        there = sign * (clavicle_m - np.sin(0.2) * rise_m), np.cos(0.2) * rise_m, 0.0
        expected = clavicle_m / np.linalg.norm(there) * np.array(there)
        assert raised[0] == pytest.approx(expected, abs=1e-5)
        assert found[f"{side}Shoulder"][0, 0] == pytest.approx(sign * inner_m, abs=1e-5)
        down = found[f"{side}ForeArm"] - found[f"{side}Arm"]
        assert down[0] == pytest.approx([0, -body.size("upper_arm_length"), 0], abs=1e-5)


def test_bones_are_those_of_the_body_and_angles_those_of_the_table(
    motion_of: Callable, joints_of_bvh: Callable, body: BodyModel, tmp_path: Path
) -> None:
    state = np.zeros(14)
    state[[1, 2, 3, 5, 8, 10, 11]] = np.radians([5, 20, 30, 40, 50, 60, 70])
    motion = motion_of(state, body, neck=np.radians([[25.0, 15.0]]))
    write_bvh(tmp_path / "a.bvh", motion, body)
    bvh = pytest.importorskip("bvh", reason="bvh is not installed")
    file = bvh.Bvh((tmp_path / "a.bvh").read_text(encoding="utf-8"))
    assert file.joint_offset("LeftForeArm") == (0.0, -body.size("upper_arm_length"), 0.0)
    assert file.joint_offset("RightHand") == (0.0, -body.size("forearm_length"), 0.0)
    for joint, channel, degrees in (
        *(("Hips", "Y", 30), ("Spine", "X", 20), ("Spine", "Z", 5)),
        *(("Neck", "Y", 25), ("Neck", "X", 15), ("LeftArm", "X", -40), ("LeftArm", "Z", 0)),
        *(("RightArm", "Z", -50), ("RightForeArm", "Z", -60), ("RightForeArm", "X", -70)),
    ):
        found = file.frame_joint_channel(0, joint, f"{channel}rotation")
        assert found == pytest.approx(degrees, abs=1e-4), (joint, channel)
    assert file.frame_time == pytest.approx(1.0)
    places = joints_of_bvh(tmp_path / "a.bvh")
    assert set(places) == {
        *("Hips", "Spine", "Chest", "Neck", "Head", "LeftShoulder", "RightShoulder"),
        *(f"{side}{bone}" for side in ("Left", "Right") for bone in ("UpLeg", "Leg", "Foot")),
        *JOINTS,
    }


def test_legs_are_where_the_markers_have_them_and_stand_if_they_are_not_measured(
    motion_of: Callable, joints_of_bvh: Callable, body: BodyModel, tmp_path: Path
) -> None:
    states = np.zeros((3, 14))
    states[:, 3] = 0.4, -0.9, 0.2
    low, high = LEG_LIMITS.T
    legs = low + np.random.default_rng(5).uniform(0, 1, (3, 8)) * (high - low)
    motion = motion_of(states, body, legs=legs)
    write_bvh(tmp_path / "a.bvh", motion, body)
    found, markers = joints_of_bvh(tmp_path / "a.bvh"), markers_of(motion, body)
    for bone, marker in zip(("UpLeg", "Leg", "Foot"), ("Hip", "Knee", "Ankle"), strict=True):
        for side in ("Left", "Right"):
            expected_m = markers.points_m[:, markers.names.index(f"{side[0]}{marker}")]
            assert found[f"{side}{bone}"] @ TO_LABORATORY.T == pytest.approx(expected_m, abs=1e-3)
    write_bvh(tmp_path / "b.bvh", motion_of(states, body), body)
    feet = joints_of_bvh(tmp_path / "b.bvh")["LeftFoot"]
    ankle_m = 0.039 * 1.72
    assert feet[:, 1] == pytest.approx([ankle_m] * 3, abs=1e-3)


def test_gaps_repeat_the_posture_before(
    motion_of: Callable, joints_of_bvh: Callable, body: BodyModel, tmp_path: Path
) -> None:
    gap, first, second = np.full(14, np.nan), np.zeros(14), np.full(14, 0.2)
    write_bvh(tmp_path / "a.bvh", motion_of([gap, first, gap, second], body), body)
    hands = joints_of_bvh(tmp_path / "a.bvh")["LeftHand"]
    assert hands[0] == pytest.approx(hands[1])
    assert hands[2] == pytest.approx(hands[1])
    assert np.linalg.norm(hands[3] - hands[2]) > 0.1


def test_the_body_is_needed(motion_of: Callable, body: BodyModel, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"give --model MODEL.yaml"):
        write_bvh(tmp_path / "a.bvh", motion_of(np.zeros(14), body), None)
    assert list(tmp_path.iterdir()) == []
