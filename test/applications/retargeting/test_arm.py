"""The robot's arm points as the person's, as far as its joints allow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.arm import ArmFollower, directions_of, hand_of
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import load_robot, parse_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import JOINT_LIMITS
from cardbox_tracker.person.skeleton import JOINT_NAMES

ROBOT = load_robot(Path(__file__).parents[3] / "config" / "example_arm.urdf")
BODY = body_from_proportions(1.75, 2.0)


def posture(**angles_deg: float) -> np.ndarray:
    """Return a posture with unknown head and hands, (16,)."""
    d = np.array([*np.zeros(12), *np.full(4, np.nan)])
    for name, value in angles_deg.items():
        d[JOINT_NAMES.index(name)] = np.radians(value)
    return d


@pytest.mark.parametrize(
    ("angles_deg", "upper", "fore"),
    [
        ({}, (0, 0, -1), (0, 0, -1)),
        ({"right_shoulder_flexion": 90}, (1, 0, 0), (1, 0, 0)),
        ({"right_elbow_flexion": 90, "torso_yaw": 50}, (0, 0, -1), (1, 0, 0)),
    ],
)
def test_directions_are_those_in_the_torso(
    angles_deg: dict[str, float], upper: tuple[float, ...], fore: tuple[float, ...]
) -> None:
    found = directions_of(BODY, posture(**angles_deg), "right")
    np.testing.assert_allclose(found[:2], [upper, fore], atol=1e-9)


@pytest.mark.parametrize("turn_deg", [0.0, 90.0])
def test_the_robots_segments_point_as_the_persons(turn_deg: float) -> None:
    follower = ArmFollower(ROBOT, RetargetConfig(mount_yaw_deg=turn_deg))
    assert follower.arm.joints[follower.kinematics.elbow] == "elbow_pitch"
    assert follower.kinematics.reach_m == pytest.approx(0.68)  # the lengths of the URDF
    wanted = posture(right_shoulder_abduction=40, right_shoulder_flexion=20, right_elbow_flexion=60)
    found = np.zeros(7)
    for _ in range(4):
        found = follower.target(BODY, wanted, found)
    # The robot's X is to the person's left if it is turned by a quarter.
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    mount = quarter if turn_deg else np.eye(3)
    expected = directions_of(BODY, wanted, "right") @ mount
    cosines = (follower.kinematics.directions(found) * expected).sum(axis=1)
    # Beyond the limits of its shoulder the robot cannot have all of them.
    assert (cosines > np.cos(np.radians(6.0 if not turn_deg else 90.0))).all()
    assert cosines[2] > np.cos(np.radians(6.0))


@pytest.mark.parametrize(
    ("error", "other", "swings"),
    [(0.2, 0.11, False), (0.2, 0.09, True), (0.08, 0.03, True), (0.06, 0.0, False)],
)
def test_an_arm_swings_only_from_a_bad_solution_to_a_much_better_one(
    error: float, other: float, swings: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bad is 0.07, about 15 degrees; much better is half of the squared error."""
    follower, errors = ArmFollower(ROBOT, RetargetConfig()), iter([error, other])
    monkeypatch.setattr(follower, "_solved", lambda start, wanted: (start, next(errors)))
    now = np.full(7, 0.1)
    assert (follower.target(BODY, posture(), now) != now).any() == swings


@hypothesis_settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=7, max_size=7))
def test_the_derivatives_are_those_of_the_directions(positions: list[float]) -> None:
    config = RetargetConfig(trunk_radius_m=0.0, lowest_m=10.0)  # all of the forearm is too low
    kinematics = ArmFollower(ROBOT, config).kinematics
    q, zero = np.array(positions), np.zeros((3, 3))
    off, slope = kinematics.residual(q, zero)
    for number in range(7):
        step = 1e-6 * np.eye(7)[number]
        there, _ = kinematics.residual(q + step, zero)
        np.testing.assert_allclose((there - off) / 1e-6, slope[:, number], atol=1e-4)


@hypothesis_settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=7, max_size=7))
def test_the_derivatives_are_those_of_the_hand(positions: list[float]) -> None:
    kinematics = ArmFollower(ROBOT, RetargetConfig(trunk_radius_m=0.0, lowest_m=10.0)).kinematics
    q, zero = np.array(positions), np.zeros(3)
    off, slope = kinematics.hand_residual(q, zero, zero)
    for number in range(7):
        there, _ = kinematics.hand_residual(q + 1e-6 * np.eye(7)[number], zero, zero)
        np.testing.assert_allclose((there - off) / 1e-6, slope[:, number], atol=1e-4)


@pytest.mark.parametrize("scale", [1.0, 0.7])
def test_the_hand_alone_is_followed_upright_whatever_the_elbow_does(scale: float) -> None:
    rest = "elbow_pitch=-1.6"
    config = RetargetConfig(follow="hand", hand_scale=scale, rest=rest, trunk_radius_m=0.0)
    follower = ArmFollower(ROBOT, config)
    wanted = posture(right_shoulder_abduction=40, right_shoulder_flexion=20, right_elbow_flexion=60)
    found = np.zeros(7)
    for _ in range(8):
        found = follower.target(BODY, wanted, found)
    places = follower.kinematics.at(found)
    place = (places.tip_m - places.origins_m[1]) / follower.kinematics.reach_m
    np.testing.assert_allclose(place, scale * hand_of(BODY, wanted, "right"), atol=0.02)
    middle = np.mean(ROBOT.limits_of(follower.arm.joints)[:2], axis=0)
    at_rest = ROBOT.positions_of("rest", rest, follower.arm.joints, middle)
    tilt = follower.kinematics.at(at_rest).turn[2]
    assert places.turn[2] @ tilt > np.cos(np.radians(8.0))


def test_with_a_clutch_the_hand_moves_as_the_persons_from_where_it_is() -> None:
    config = RetargetConfig(follow="hand", clutch=True, max_speed=20.0, trunk_radius_m=0.0)
    follower = ArmFollower(ROBOT, config)
    robot = Retargeter(ROBOT, follower, config)
    start = np.array([-0.6, -0.5, 0.4, -1.2, 0.3, 0.2, 0.0])
    robot.begin(start)
    before = posture(right_shoulder_abduction=40, right_elbow_flexion=60)
    after = posture(right_shoulder_abduction=60, right_shoulder_flexion=15, right_elbow_flexion=70)
    hands, tilts = [], []
    for number in range(40):
        now = before if number < 20 else after
        robot.update(number * 10**8, "tracking", BODY, now[:14], np.full(14, 0.1))
        places = follower.kinematics.at(robot.at((number + 1) * 10**8).positions)
        hands.append(follower.kinematics.hand(places))
        tilts.append(places.turn[2])
    there = follower.kinematics.hand(follower.kinematics.at(start))
    np.testing.assert_allclose(hands[:20], np.tile(there, (20, 1)), atol=0.02)
    way = hand_of(BODY, after, "right") - hand_of(BODY, before, "right")
    assert np.linalg.norm(way) > 0.2
    np.testing.assert_allclose(hands[-1] - there, way, atol=0.02)
    assert tilts[-1] @ follower.kinematics.at(start).turn[2] > np.cos(np.radians(8.0))


def test_a_rest_of_another_joint_is_refused() -> None:
    with pytest.raises(CardboxError, match=r"rest 'jaw=1' is not JOINT=VALUE.*wrist_pitch"):
        ArmFollower(ROBOT, RetargetConfig(rest="jaw=1"))
    with pytest.raises(CardboxError, match="rest 'elbow_pitch=9' is beyond"):
        ArmFollower(ROBOT, RetargetConfig(rest="elbow_pitch=9"))


ASIDE = """<robot name="g"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<link name="hand"/><joint name="roll" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="0 -0.2 0.3"/><axis xyz="1 0 0"/></joint>
<joint name="pitch" type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="continuous"><parent link="c"/><child link="d"/>
<origin xyz="0 0 -0.3"/><axis xyz="1 0 0"/></joint>
<joint name="end" type="fixed"><parent link="d"/><child link="hand"/>
<origin xyz="0 0 -0.2"/></joint>
</robot>"""


def test_a_hand_in_the_trunk_or_in_the_table_is_moved_out() -> None:
    config = RetargetConfig(trunk_radius_m=0.1, lowest_m=0.1)
    follower = ArmFollower(parse_robot(ASIDE), config)
    # The hand is at the axis below the shoulder, the middle of the forearm at the radius.
    gaps, slopes = follower.kinematics.too_near(np.array([0.0, 0.0, np.pi / 2]))
    assert gaps == pytest.approx([-0.1, -0.1, -0.1], abs=1e-5)
    hanging = np.zeros(3)
    gaps, slopes = follower.kinematics.too_near(hanging)
    assert gaps == pytest.approx([-0.2, -0.3])  # middle and hand are at -0.1 and -0.2 m
    bent = np.array([0.1, 0.2, 0.3])
    gaps, slopes = follower.kinematics.too_near(bent)
    for number in range(3):
        there, _ = follower.kinematics.too_near(bent + 1e-6 * np.eye(3)[number])
        np.testing.assert_allclose((there - gaps) / 1e-6, slopes[:, number], atol=1e-4)


@hypothesis_settings(max_examples=8, deadline=None)
@given(st.lists(st.lists(st.floats(0, 1), min_size=4, max_size=4), min_size=2, max_size=4))
def test_no_way_leads_through_the_trunk_or_the_table(shares: list[list[float]]) -> None:
    config = RetargetConfig(trunk_radius_m=0.15, lowest_m=-0.1, soft_start_s=0.0)
    robot = parse_robot(ASIDE)
    follower = ArmFollower(robot, config)
    retargeter = Retargeter(robot, follower, config)
    retargeter.begin(np.array([-0.5, -1.2, 0.0]))
    least = 0.0
    for number, share in enumerate(np.repeat(shares, 20, axis=0)):
        wanted = np.zeros(12)
        wanted[8:] = JOINT_LIMITS[8:, 0] + share * np.ptp(JOINT_LIMITS[8:], axis=1)
        retargeter.update(number * 50_000_000, "tracking", BODY, wanted, np.full(12, 0.1))
        for part in (0, 25_000_000):
            moment = retargeter.at(number * 50_000_000 + part)
            gaps, _ = follower.kinematics.too_near(moment.positions)
            least = min(least, *gaps, 0.0)
    assert least > -0.02


@hypothesis_settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=12, max_size=12))
def test_the_target_is_within_the_limits(share: list[float]) -> None:
    follower = ArmFollower(ROBOT, RetargetConfig())
    lower, upper, _ = ROBOT.limits_of(follower.joints)
    wanted = posture()
    wanted[:12] = JOINT_LIMITS[:, 0] + np.array(share) * np.ptp(JOINT_LIMITS, axis=1)
    found = follower.target(BODY, wanted, np.zeros(7))
    assert (found >= lower).all() and (found <= upper).all()


GRIPPER = """<robot name="g"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<link name="tcp"/><link name="jaw"/>
<joint name="pan" type="continuous"><parent link="a"/><child link="b"/>
<origin xyz="0 0 0.1"/><axis xyz="0 0 1"/></joint>
<joint name="lift" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="0"/></joint>
<joint name="elbow" type="revolute"><parent link="c"/><child link="d"/>
<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1"/></joint>
<joint name="end" type="fixed"><parent link="d"/><child link="tcp"/><origin xyz="0 0 0.3"/></joint>
<joint name="jaw_slide" type="prismatic"><parent link="tcp"/><child link="jaw"/>
<limit lower="0" upper="0.04" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(("open_at", "expected"), [("upper", 0.04), ("lower", 0.0)])
def test_the_gripper_opens_and_closes_with_the_hand(open_at: str, expected: float) -> None:
    follower = ArmFollower(parse_robot(GRIPPER), RetargetConfig(gripper_open=open_at))
    assert follower.joints == ("pan", "lift", "elbow", "jaw_slide")
    wanted = posture()
    assert follower.target(BODY, wanted, np.full(4, 0.02))[3] == 0.02  # no hand: it stays
    # A hand that is neither leaves the gripper as it is, or on its way.
    for hand, there in ((0.5, 0.02), (0.8, expected), (0.5, expected), (0.2, 0.04 - expected)):
        wanted[15] = hand
        assert follower.target(BODY, wanted, np.full(4, 0.02))[3] == pytest.approx(there)
    wanted[15] = np.nan
    assert follower.target(BODY, wanted, np.full(4, 0.02))[3] == 0.02


def test_a_mimic_moves_with_its_joint() -> None:
    """A second elbow that copies the first by half bends the forearm by a half more."""
    text = GRIPPER.replace(
        '<joint name="end" type="fixed">',
        '<joint name="copy" type="revolute"><mimic joint="elbow" multiplier="0.5"/>'
        '<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1"/>',
    )
    follower = ArmFollower(parse_robot(text), RetargetConfig(hand="tcp"))
    # The tip is before the turn of the copy; the elbow alone turns it.
    assert follower.arm.joints == ("pan", "lift", "elbow")
    ahead = text.replace('<link name="jaw"/>', '<link name="jaw"/><link name="end"/>').replace(
        "</robot>",
        '<joint name="last" type="fixed"><parent link="tcp"/><child link="end"/>'
        '<origin xyz="0 0 0.1"/></joint></robot>',
    )
    follower = ArmFollower(parse_robot(ahead), RetargetConfig(hand="end"))
    hand = follower.kinematics.at(np.array([0, 0, np.pi / 2])).tip_m
    turned = 0.75 * np.pi
    expected = [0.3 + 0.1 * np.sin(turned), 0.0, 0.4 + 0.1 * np.cos(turned)]
    assert hand == pytest.approx(expected)


def test_a_robot_that_is_no_arm_is_told() -> None:
    with pytest.raises(CardboxError, match="no link 'foot'"):
        ArmFollower(ROBOT, RetargetConfig(hand="foot"))
    with pytest.raises(CardboxError, match="1 joint"):
        ArmFollower(ROBOT, RetargetConfig(hand="shoulder_roll_link"))
