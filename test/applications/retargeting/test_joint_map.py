"""The example map moves all joints of a seven-axis arm, and heads follow where they are known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import (
    angles_of,
    load_joint_map,
    with_head_and_hands,
)
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import load_robot, parse_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import RIGHT_ARM
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    arm_directions,
    rotation_x,
    rotation_y,
    rotation_z,
)

CONFIG = Path(__file__).parents[3] / "config"
ROBOT = load_robot(CONFIG / "example_arm.urdf")
MAP = load_joint_map(CONFIG / "example_joint_map.yaml")
BODY = body_from_proportions(1.75, 2.0)


def with_right_arm(*angles_rad: float) -> np.ndarray:
    posture = np.zeros(16)
    posture[RIGHT_ARM] = angles_rad
    return posture


def test_the_example_map_has_every_joint_of_the_example_arm() -> None:
    assert MAP.joints == tuple(ROBOT.joints)
    assert len(MAP.joints) == 7
    assert {name for each in MAP.sources for name in each} == {
        name for name in JOINT_NAMES if name.startswith("right_")
    }


@given(
    st.tuples(st.floats(-0.7, 3.1), st.floats(-1.0, 1.5), st.floats(-1.5, 1.5), st.floats(0.2, 1.6))
)
def test_the_robots_segments_point_as_the_persons(angles_rad: tuple[float, ...]) -> None:
    """The joints of the URDF turn by Rx Ry to the elbow, then by Rz Ry to the wrist."""
    posture = with_right_arm(*angles_rad)
    roll, pitch, yaw, elbow, *rest = MAP.target(BODY, posture, np.zeros(7))
    upper = rotation_x(roll) @ rotation_y(pitch)
    fore = upper @ rotation_z(yaw) @ rotation_y(elbow)
    expected = arm_directions(posture[RIGHT_ARM], -1.0)
    np.testing.assert_allclose([-upper[:, 2], -fore[:, 2]], expected, atol=1e-9)
    assert rest == [0.0, 0.0, 0.0]


def test_a_stretched_arm_does_not_turn() -> None:
    now = np.full(7, 0.3)
    target = MAP.target(BODY, with_right_arm(0.5, 0.2, 0.0, 0.01), now)
    assert target.tolist() == pytest.approx([-0.5, -0.2, 0.3, -0.01, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("abduction_deg", "flexion_deg", "bend_deg", "turn_deg"),
    [(0, 90, 90, 0), (90, 0, 90, 90), (-90, 0, 90, -90), (0, 30, 30, 0), (45, 0, 45, 90)],
)
def test_bend_and_turn_of_known_arms(
    abduction_deg: float, flexion_deg: float, bend_deg: float, turn_deg: float
) -> None:
    posture = with_right_arm(0, 0, math.radians(abduction_deg), math.radians(flexion_deg))
    found = angles_of(posture)
    assert math.degrees(found["right_elbow_bend"]) == pytest.approx(bend_deg)
    assert math.degrees(found["right_upper_arm_turn"]) == pytest.approx(turn_deg)
    assert math.isnan(found["left_upper_arm_turn"])


HEAD = """<robot name="h"><link name="a"/><link name="b"/><link name="c"/>
<joint name="head_yaw" type="revolute"><parent link="a"/><child link="b"/>
<limit lower="-1" upper="1" velocity="0" effort="1"/></joint>
<joint name="elbow" type="revolute"><parent link="b"/><child link="c"/>
<limit lower="-2" upper="2" velocity="0" effort="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("neck_stddev", "yaw"),
    [([0.1, 0.1], 0.4), ([], 0.0), ([2.0, 0.1], 0.0), ([math.nan, 0.1], 0.0)],
)
def test_a_head_follows_only_where_it_is_known(
    tmp_path: Path, neck_stddev: list[float], yaw: float
) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(
        "joints:\n  - {from: neck_yaw, to: head_yaw}\n  - {from: left_elbow_flexion, to: elbow}\n"
    )
    config = RetargetConfig(
        max_speed=20.0, max_acceleration=1000.0, max_jerk=1e6, longest_step_s=1.0, soft_start_s=0.0
    )
    robot = Retargeter(parse_robot(HEAD), load_joint_map(path), config)
    posture = np.array([*np.zeros(12), 0.4, 0.2])
    posture[JOINT_NAMES.index("left_elbow_flexion")] = 1.0
    stddev = np.array([*np.full(12, 0.1), *neck_stddev])
    for second in range(2):
        command = robot.update(second * 10**9, "tracking", BODY, posture, stddev)
    assert command.is_moving
    assert robot.at(3 * 10**9).positions.tolist() == pytest.approx([yaw, 1.0])


def test_a_posture_without_a_neck_has_an_unknown_one() -> None:
    whole = with_head_and_hands(np.ones(12), np.zeros(12), 0.5)
    assert whole[:12].tolist() == [1.0] * 12
    assert np.isnan(whole[12:]).all()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("joints: []", "empty list"),
        ("arms: 1", "'joints'"),
        ("joints: [{from: left_elbow_flexion}]", "needs 'to'"),
        ("joints: [{from: knee, to: a}]", "'knee'.* torso_y"),
        ("joints: [{from: left_elbow_flexion, to: a, scale: .inf}]", "finite number"),
        (
            "joints: [{from: left_elbow_flexion, to: a}, {from: torso_yaw, to: a}]",
            "two rows",
        ),
    ],
)
def test_what_is_no_joint_map_is_told(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(CardboxError, match=expected):
        load_joint_map(path)
