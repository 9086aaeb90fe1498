"""The robot's hand goes where the person's is, as far as its limits allow."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.hand import HandFollower, hand_of
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import load_robot, parse_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.proportions import body_from_proportions
from cardbox_tracker.person.skeleton import JOINT_NAMES

ROBOT = load_robot(Path(__file__).parents[3] / "config" / "example_arm.urdf")
BODY = body_from_proportions(1.75, 2.0)


def posture(**angles_deg: float) -> np.ndarray:
    d = np.zeros(12)
    for name, value in angles_deg.items():
        d[JOINT_NAMES.index(name)] = np.radians(value)
    return d


@pytest.fixture
def libraries() -> None:
    pytest.importorskip("pink", reason="pin-pink is not installed")
    pytest.importorskip("daqp", reason="daqp is not installed")


@pytest.mark.parametrize(
    ("angles_deg", "expected"),
    [
        ({}, (0, 0, -1)),
        ({"right_shoulder_flexion": 90}, (1, 0, 0)),
        ({"right_shoulder_abduction": 90}, (0, -1, 0)),
        ({"torso_yaw": 50, "torso_pitch": 30}, (0, 0, -1)),
    ],
)
def test_the_hand_is_seen_from_the_shoulder_in_the_torso(
    angles_deg: dict[str, float], expected: tuple[float, ...]
) -> None:
    assert hand_of(BODY, posture(**angles_deg), "right") == pytest.approx(expected, abs=1e-9)


@pytest.mark.usefixtures("libraries")
def test_the_robots_hand_gets_there() -> None:
    config = RetargetConfig(reach=0.9, max_speed=20.0, longest_step_s=1.0)
    follower = HandFollower(ROBOT, config)
    assert follower.reach_m == pytest.approx(0.68)  # the lengths of the URDF
    robot = Retargeter(ROBOT, follower, config)
    wanted = posture(right_shoulder_abduction=30, right_shoulder_flexion=40, right_elbow_flexion=60)
    for second in range(4):
        command = robot.update(second * 10**9, "tracking", BODY, wanted, np.zeros(12))
    shoulder = np.array([0.0, -0.16, 0.0])
    hand = follower.hand_m(command.positions) - shoulder
    assert hand == pytest.approx(0.9 * 0.68 * hand_of(BODY, wanted, "right"), abs=3e-3)


@pytest.mark.usefixtures("libraries")
def test_the_mount_turns_the_robot() -> None:
    config = RetargetConfig(mount_yaw_deg=90.0, max_speed=20.0, longest_step_s=1.0)
    follower = HandFollower(ROBOT, config)
    ahead = posture(right_shoulder_flexion=60)
    hand = follower.hand_m(follower.target(BODY, ahead, np.zeros(7))) - (0.0, -0.16, 0.0)
    # Its X is to the person's left, so ahead of them is to its right.
    assert hand[1] < -0.4 and abs(hand[0]) < 0.05


@pytest.mark.usefixtures("libraries")
@hypothesis_settings(max_examples=15)
@given(st.lists(st.lists(st.floats(0, 1), min_size=12, max_size=12), min_size=1, max_size=4))
def test_limits_and_speeds_hold_for_any_posture(shares: list[list[float]]) -> None:
    config = RetargetConfig(max_speed=2.0)
    robot = Retargeter(ROBOT, HandFollower(ROBOT, config), config)
    lower, upper, speed = ROBOT.limits_of(robot.joints)
    before = None
    for number, share in enumerate(shares):
        wanted = JOINT_LIMITS[:, 0] + np.array(share) * np.ptp(JOINT_LIMITS, axis=1)
        command = robot.update(number * 10**8, "tracking", BODY, wanted, np.zeros(12))
        assert (command.positions >= lower).all() and (command.positions <= upper).all()
        if before is not None:
            assert (np.abs(command.positions - before) <= np.minimum(speed, 2.0) * 0.1 + 1e-9).all()
        before = command.positions


@pytest.mark.usefixtures("libraries")
def test_without_a_solution_the_robot_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = pytest.importorskip("pink.exceptions")

    def fails(*_: object, **__: object) -> None:
        raise errors.PinkError("no solution")

    robot = Retargeter(ROBOT, HandFollower(ROBOT, RetargetConfig()), RetargetConfig())
    monkeypatch.setattr("pink.solve_ik", fails)
    command = robot.update(0, "tracking", BODY, posture(right_elbow_flexion=80), np.zeros(12))
    assert command.status == "frozen: no solution"
    assert not command.positions.any()


@pytest.mark.usefixtures("libraries")
def test_a_robot_that_is_no_arm_is_told() -> None:
    with pytest.raises(CardboxError, match="no link 'foot'"):
        HandFollower(ROBOT, RetargetConfig(), "foot")
    with pytest.raises(CardboxError, match="1 joint"):
        HandFollower(ROBOT, RetargetConfig(), "shoulder_roll_link")
    part = ROBOT.urdf.replace('<link name="hand_link">', '<link name="palm">')
    with pytest.raises(CardboxError, match="robot's URDF"):
        HandFollower(parse_robot(part), RetargetConfig())


def test_without_the_libraries_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(CardboxError, match=r"pip install '\.\[retarget\]'"):
        HandFollower(ROBOT, RetargetConfig())
