"""The arm is found: the waist and the gripper are not part of it, and what is unclear is told."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.applications.retargeting.arm import ArmFollower
from cardbox_tracker.applications.retargeting.chain import find_arm
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.robot import Robot, parse_robot
from cardbox_tracker.common.errors import CardboxError


def joint(name: str, parent: str, child: str, kind: str = "revolute", xyz: str = "0 0 0.2") -> str:
    limit = "<limit lower='-1' upper='1' velocity='1'/>" if kind != "fixed" else ""
    return (
        f"<link name='{child}'/><joint name='{name}' type='{kind}'><parent link='{parent}'/>"
        f"<child link='{child}'/><origin xyz='{xyz}'/>{limit}</joint>"
    )


def arm(before: str, root: str) -> str:
    names = [f"{before}shoulder", f"{before}elbow", f"{before}wrist"]
    links = [root, *(f"{name}_link" for name in names)]
    parts = [joint(*each) for each in zip(names, links, links[1:], strict=False)]
    return "".join(parts) + joint(f"{before}end", links[-1], f"{before}hand", "fixed")


def robot(*parts: str) -> Robot:
    return parse_robot(f"<robot name='r'><link name='base'/>{''.join(parts)}</robot>")


HUMANOID = (
    joint("waist", "base", "torso"),
    arm("left_", "torso"),
    arm("right_", "torso"),
    joint("head_yaw", "torso", "neck"),
    joint("head_pitch", "neck", "face"),
    joint("left_hip", "base", "left_thigh"),
    joint("left_knee", "left_thigh", "left_shank"),
)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_waist_stays_and_the_side_decides(side: str) -> None:
    found = find_arm(robot(*HUMANOID), side)
    assert found.joints == (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist")
    assert (found.tip, found.gripper, found.stays) == (f"{side}_hand", "", ("waist",))


def test_a_named_gripper_is_no_part_of_the_arm() -> None:
    """The jaw is the last moving link; the fixed frame is the hand."""
    text = arm("", "base"), joint("gripper", "wrist_link", "jaw")
    found = find_arm(robot(*text), "right")
    assert found.joints == ("shoulder", "elbow", "wrist")
    assert (found.tip, found.gripper) == ("hand", "gripper")
    assert "gripper" in found.table(robot(*text), 1.0)
    everything = find_arm(robot(*text), "right", hand="jaw", gripper="gripper")
    assert everything.joints[-1] == "gripper"


def test_several_short_branches_are_fingers() -> None:
    fingers = [joint(f"f{i}", "hand", f"g{i}", xyz="0 0 0.05") for i in range(3)]
    found = find_arm(robot(arm("", "base"), *fingers), "right")
    assert found.joints == ("shoulder", "elbow", "wrist")
    assert (found.gripper, found.stays) == ("", ("f0", "f1", "f2"))
    assert find_arm(robot(arm("", "base"), *fingers), "right", gripper="f1").gripper == "f1"


def test_a_joint_that_fingers_beside_it_mimic_is_the_gripper() -> None:
    """As the hands of NAO and Pepper; a mechanism that goes on in the arm is no hand."""
    finger = joint("tip", "wrist_link", "nail", xyz="0 0 0.05")
    finger = finger.replace("<limit", "<mimic joint='close'/><limit")
    text = arm("", "base").partition("<link name='hand'/>")[0]
    hand = robot(text, joint("close", "wrist_link", "fist", xyz="0 0 0.05"), finger)
    found = find_arm(hand, "right")
    assert found.joints == ("shoulder", "elbow", "wrist") and found.gripper == "close"
    level = joint("level", "shoulder_link", "rod", xyz="0 0 0.05")
    level = level.replace("<limit", "<mimic joint='elbow'/><limit")
    assert find_arm(robot(arm("", "base"), level), "right").joints[1] == "elbow"


@pytest.mark.parametrize(
    "names",
    [
        [f"{{}}_SHOULDER_{axis}" for axis in "PRY"],  # pitch, roll and yaw
        ["{}_arm_l1", "{}_arm_r2", "{}_arm_l3"],
        ["arm_r_{}_joint", "arm_l_{}_joint"],
    ],
)
def test_letters_of_axes_and_links_are_no_sides(names: list[str]) -> None:
    parts = []
    for side in ("left", "right"):
        word = side if "_{}_" in names[0] else side[0].upper()
        own = [name.format(word) for name in names]
        links = ["base", *(f"{name}_link" for name in own)]
        parts += [joint(*each) for each in zip(own, links, links[1:], strict=False)]
    for side in ("left", "right"):
        assert f"{side[0]}_" in find_arm(robot(*parts), side).joints[0].lower().replace(
            side, side[0]
        )


@pytest.mark.parametrize("yaw_deg", [0, 90, 180, -90])
def test_a_root_that_looks_elsewhere_is_turned_by_its_shoulders(yaw_deg: int) -> None:
    turn = f"<origin rpy='0 0 {-np.radians(yaw_deg)}' xyz='0 0 1'/>"
    parts = [joint("waist", "base", "torso", "fixed").replace("<origin xyz='0 0 0.2'/>", turn)]
    for side, aside in (("left", 0.2), ("right", -0.2)):
        first = arm(f"{side}_", "torso").replace("0 0 0.2", f"0 {aside} 0.2", 1)
        parts.append(first.replace("0 0 0.2", "0 0 -0.2"))
    found = robot(*parts)
    follower = ArmFollower(found, RetargetConfig(side="left"))
    assert follower.turned_deg % 360 == yaw_deg % 360
    # X of the torso, which is ahead, is where the robot's torso looks.
    ahead = np.array([np.cos(np.radians(-yaw_deg)), np.sin(np.radians(-yaw_deg)), 0.0])
    assert follower.mount @ ahead == pytest.approx([1.0, 0.0, 0.0])
    assert ArmFollower(found, RetargetConfig(side="left", mount_roll_deg=5)).turned_deg == 0.0


def test_the_base_is_given() -> None:
    rail = joint("rail", "base", "sledge"), arm("", "sledge")
    assert find_arm(robot(*rail), "right").joints[0] == "rail"
    found = find_arm(robot(*rail), "right", base="sledge")
    assert found.joints == ("shoulder", "elbow", "wrist")
    assert found.stays == ("rail",)


def test_what_is_unclear_is_refused_with_the_candidates() -> None:
    two = robot(joint("waist", "base", "torso"), arm("one_", "torso"), arm("two_", "torso"))
    with pytest.raises(CardboxError, match=r"2 arms, .* right one; .* one_hand, two_hand"):
        find_arm(two, "right")
    assert find_arm(two, "right", hand="two_hand").joints[0] == "two_shoulder"
    with pytest.raises(CardboxError, match="no chain of two joints"):
        find_arm(robot(joint("a", "base", "b")), "right")
    with pytest.raises(CardboxError, match="'two_hand' is not before the hand"):
        find_arm(two, "right", base="two_hand", hand="one_hand")
