"""Whatever is measured, a robot keeps its limits and speeds, and stands still when it must."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.arm import ArmFollower
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.retargeter import (
    Limits,
    Retargeter,
    SafeMotion,
    make_retargeter,
)
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import JOINT_NAMES

CONFIG = Path(__file__).parents[3] / "config"
ROBOT = load_robot(CONFIG / "example_arm.urdf")
MAP = load_joint_map(CONFIG / "example_joint_map.yaml")
BODY = body_from_proportions(1.75, 2.0)
SURE = np.full(12, 0.1)
PERIOD_NS = 66_666_667
MAP_ORDER = [MAP.joints.index("shoulder_roll"), MAP.joints.index("elbow_pitch")]

numbers = st.floats(allow_nan=True, allow_infinity=True)
twelve = st.lists(numbers, min_size=12, max_size=12).map(np.array)
images = st.lists(
    st.tuples(
        st.integers(-(10**10), 10**12),
        st.sampled_from(["tracking", "uncertain", "lost", "no_person", "", "TRACKING"]),
        st.none() | twelve,
        st.none() | twelve,
    ),
    max_size=12,
)
settings = st.builds(
    RetargetConfig,
    max_speed=st.floats(0.01, 20),
    max_acceleration=st.floats(1, 100),
    max_jerk=st.floats(10, 10_000),
    max_stddev_rad=st.floats(0.05, 3.2),
    longest_step_s=st.floats(0.01, 1),
    soft_start_s=st.floats(0, 2),
    clutch=st.booleans(),
)
STEP_NS = 5_000_000


def assert_within(positions: np.ndarray, limits: Limits, config: RetargetConfig) -> None:
    """Check a motion (k, n) sampled each 5 ms, by its differences."""
    step_s = STEP_NS / 1e9
    assert (positions >= limits.lower).all() and (positions <= limits.upper).all()
    most = (np.minimum(limits.speed, config.max_speed), config.max_acceleration, config.max_jerk)
    for number, highest in enumerate(most, 1):
        change = np.diff(positions, number, axis=0) / step_s**number
        assert (np.abs(change) <= highest * (1 + 1e-6) + 1e-12 / step_s**number).all()


# An infinite deviation of an arm that hangs.
@example([(0, "tracking", np.zeros(12), np.append(np.zeros(11), np.inf))], [0], RetargetConfig())
@given(images, st.lists(st.integers(0, 100), min_size=12, max_size=12), settings)
def test_all_limits_hold_for_any_input(
    sequence: list[tuple[int, str, np.ndarray | None, np.ndarray | None]],
    waits: list[int],
    config: RetargetConfig,
) -> None:
    robot = Retargeter(ROBOT, MAP, config)
    stamp_ns, now_ns, way = 0, 0, []
    for (step_ns, state, posture, stddev), wait in zip(sequence, waits, strict=False):
        for _ in range(wait):
            way.append(robot.at(now_ns).positions)
            now_ns += STEP_NS
        stamp_ns += step_ns
        before = robot.at(now_ns)
        command = robot.update(stamp_ns, state, BODY, posture, stddev, now_ns)
        after = robot.at(now_ns)
        np.testing.assert_allclose(after.positions, before.positions, atol=1e-9)
        np.testing.assert_allclose(after.velocities, before.velocities, atol=1e-6)
        if posture is None or stddev is None or state not in ("tracking", "uncertain"):
            assert not command.is_moving
        if not command.is_moving:
            still = robot.at(now_ns + robot.settles_ns)
            np.testing.assert_allclose(still.positions, command.positions, atol=1e-9)
            assert not still.velocities.any()
    way += [robot.at(now_ns + i * STEP_NS).positions for i in range(60)]
    assert_within(np.array(way), Limits(*ROBOT.limits_of(MAP.joints)), config)


def test_the_way_of_a_set_point_is_the_mean_over_both_times() -> None:
    """At 1 rad/s for 1 s, with means over 0.1 and 0.2 s: 0.15 s late, and 1 rad at the end."""
    limits = Limits(np.array([-9.0]), np.array([9.0]), np.array([1.0]))
    motion = SafeMotion(limits, np.zeros(1), acceleration=20.0, jerk=200.0)
    motion.move(np.array([5.0]), 0, 10**9)
    assert motion.settles_ns == pytest.approx(3e8, abs=2)
    # At 0.1 s the mean over 0.1 s has moved as t^2/0.2, whose mean over 0.2 s is t^3/(0.6*0.2).
    assert motion.at(10**8).positions == pytest.approx(0.1**3 / 0.12)
    assert motion.at(5 * 10**8).positions == pytest.approx(0.35)
    assert motion.at(5 * 10**8).velocities == pytest.approx(1.0)
    assert motion.at(13 * 10**8 + 1).positions == pytest.approx(1.0)
    motion.move(np.array([math.nan]), 5 * 10**8, 10**9)  # it decelerates for 0.3 s
    assert motion.at(8 * 10**8).positions == pytest.approx(0.5)
    assert not motion.at(8 * 10**8 + 1).velocities.any()


def follow(robot: Retargeter, images: int, posture: np.ndarray | None = None) -> None:
    """Show a posture at 10 Hz for a time."""
    posture = reference_posture("arms") if posture is None else posture
    for tenth in range(images):
        robot.update(tenth * 10**8, "tracking", BODY, posture, SURE)


def test_an_arm_gets_where_it_is_wanted_at_its_speed() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(max_speed=1.0, soft_start_s=0.0))
    follow(robot, 30)
    assert robot.at(3 * 10**9).positions == pytest.approx([-math.radians(80), *[0.0] * 6])


def test_a_faster_robot_is_no_later() -> None:
    """Acceleration and jerk follow the speed, so that stopping takes 0.2 s at each."""
    for speed in (0.25, 0.5, 1.0, 2.0):
        robot = Retargeter(ROBOT, MAP, RetargetConfig(max_speed=speed))
        assert robot.settles_ns == pytest.approx(2e8, rel=1e-6)
    own = RetargetConfig(max_acceleration=10.0, max_jerk=100.0)
    assert Retargeter(ROBOT, MAP, own).settles_ns == pytest.approx(4e8, rel=1e-6)


def test_the_start_is_soft_and_where_the_robot_is() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(start="shoulder_roll=0.4", longest_step_s=0.1))
    assert robot.at(0).positions[0] == 0.4
    follow(robot, 2)
    # A tenth of the speed for the second image.
    assert robot.at(10**9).positions[0] == pytest.approx(0.39)
    robot.begin(np.full(7, 0.05))
    assert robot.at(2 * 10**9).positions.tolist() == [0.05] * 7
    with pytest.raises(CardboxError, match="'wheel=1' is not JOINT=VALUE"):
        Retargeter(ROBOT, MAP, RetargetConfig(start="wheel=1"))
    with pytest.raises(CardboxError, match="'shoulder_roll=1' is beyond"):
        Retargeter(ROBOT, MAP, RetargetConfig(start="shoulder_roll=1"))


def test_with_a_clutch_only_movements_are_followed() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(clutch=True, max_speed=20.0))
    follow(robot, 20)
    assert robot.at(2 * 10**9).positions == pytest.approx(np.zeros(7))
    moved = reference_posture("arms")
    moved[JOINT_NAMES.index("right_shoulder_flexion")] += 0.1
    for tenth in range(20, 60):
        robot.update(tenth * 10**8, "tracking", BODY, moved, SURE)
    assert robot.at(6 * 10**9).positions[1] == pytest.approx(-0.1)


def test_a_joint_holds_while_its_own_keypoints_are_not_tracked() -> None:
    """The elbow follows the hand, the shoulder the elbow; another arm does not matter."""
    posture = np.full(12, 0.3)
    seen = {"right_elbow": ("tracked", 0.1), "left_hand": ("lost", 0.9)}
    for hand, moves in (("tracked", True), ("hidden", False)):
        robot = Retargeter(ROBOT, MAP, RetargetConfig())
        for tenth in range(9):
            keypoints = {**seen, "right_hand": (hand, 0.1)}
            robot.update(tenth * 10**8, "uncertain", BODY, posture, SURE, keypoints=keypoints)
        velocities = robot.at(8 * 10**8).velocities[MAP_ORDER]
        assert velocities[0] != 0.0
        assert (velocities[1] != 0.0) == moves
    keypoints = {**seen, "right_elbow": ("tracked", 0.6), "right_hand": ("tracked", 0.6)}
    command = robot.update(10**9, "uncertain", BODY, posture, SURE, keypoints=keypoints)
    assert not command.is_moving or not robot.at(2 * 10**9).velocities.any()


@pytest.mark.parametrize(
    ("elbow", "hand", "moves"),
    [("uncertain", "tracked", True), ("tracked", "uncertain", False)],
)
def test_of_a_hand_that_is_followed_alone_its_keypoint_decides(
    elbow: str, hand: str, moves: bool
) -> None:
    config = RetargetConfig(follow="hand")
    robot = Retargeter(ROBOT, ArmFollower(ROBOT, config), config)
    keypoints = {"right_elbow": (elbow, 0.3), "right_hand": (hand, 0.3)}
    # The elbow may be anywhere about the line from the shoulder to the hand.
    given = "uncertain", BODY, np.full(12, 0.3), np.full(12, 3.0)
    for tenth in range(5):
        command = robot.update(tenth * 10**8, *given, keypoints=keypoints)
    assert command.is_moving == moves


@pytest.mark.parametrize(
    ("state", "deviation", "status"),
    [
        ("lost", 0.1, "holding: lost"),
        ("no_person", 0.1, "holding: no person"),
        ("uncertain", 0.1, "holding: uncertain"),
        ("", 0.1, "holding: no state yet"),
        ("tracking", 0.8, "holding: too uncertain"),
        ("tracking", math.nan, "holding: too uncertain"),
        ("tracking", 0.1, "following"),
    ],
)
def test_the_dead_man(state: str, deviation: float, status: str) -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(longest_step_s=0.05))
    posture = reference_posture("arms")
    follow(robot, 5)
    assert robot.update(5 * 10**8, state, BODY, posture, np.full(12, deviation)).status == status
    assert robot.at(5 * 10**8).velocities.any()  # it decelerates
    assert not robot.at(10**9).velocities.any()
    assert robot.update(10**9, "tracking", None, posture, SURE).status == "holding: no body model"


@pytest.mark.parametrize(
    ("flexion_deg", "spread_rad", "moves"),
    [(88.0, 1.8, True), (72.0, 4.0, True), (30.0, 1.8, False)],
    ids=["along the axis", "on a narrow cone", "across"],
)
def test_a_limb_along_the_axis_of_its_abduction_has_a_sure_direction(
    flexion_deg: float, spread_rad: float, moves: bool
) -> None:
    """A forearm straight ahead is known, and its abduction is not."""
    posture, stddev = np.zeros(12), SURE.copy()
    posture[JOINT_NAMES.index("right_elbow_flexion")] = np.radians(flexion_deg)
    stddev[JOINT_NAMES.index("right_elbow_abduction")] = spread_rad
    _, robot, _ = make_retargeter(CONFIG / "example_arm.urdf", None, RetargetConfig())
    assert robot.update(0, "tracking", BODY, posture, stddev).is_moving == moves
    # What follows the abduction alone needs it.
    only = replace(MAP, angles=tuple("right_elbow_abduction" for _ in MAP.angles))
    single = Retargeter(ROBOT, only, RetargetConfig())
    assert not single.update(0, "tracking", BODY, posture, stddev).is_moving


@pytest.mark.parametrize(("wanted_rad", "reached_rad"), [(0.15, 0.15), (1.0, 0.2)])
def test_what_is_not_yet_there_goes_on_until_the_next_image_for_the_longest_step(
    wanted_rad: float, reached_rad: float
) -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(soft_start_s=0.0))
    posture = np.zeros(12)
    posture[JOINT_NAMES.index("right_shoulder_flexion")] = wanted_rad
    for tenth in range(2):
        command = robot.update(tenth * 10**8, "tracking", BODY, posture, SURE)
    assert command.duration_s == pytest.approx(0.1)
    assert robot.at(10**9).positions[1] == pytest.approx(-reached_rad)


def test_an_unsure_image_is_as_one_that_is_missing() -> None:
    """The arm goes on to where it was last sure, for the longest step; then it holds."""
    robot = Retargeter(ROBOT, MAP, RetargetConfig(soft_start_s=0.0))
    there, elsewhere = np.zeros(12), np.zeros(12)
    number = JOINT_NAMES.index("right_shoulder_flexion")
    there[number], elsewhere[number] = 0.5, -0.5
    unsure = np.full(12, 2.0)
    said = []
    for tenth in range(9):
        sure = tenth in (0, 1, 4)
        now = there if sure else elsewhere
        command = robot.update(tenth * 10**8, "tracking", BODY, now, SURE if sure else unsure)
        said.append(command.status)
    assert said == ["following"] * 7 + ["holding: too uncertain"] * 2
    moved = [robot.at(tenth * 10**8).positions[1] for tenth in (1, 5, 9, 20)]
    assert moved == sorted(moved, reverse=True) and moved[-1] == pytest.approx(-0.5)


def test_after_holding_nothing_is_made_up_for() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig())
    robot.update(0, "tracking", BODY, reference_posture("arms"), SURE)
    assert robot.hold("no posture", 10**8).status == "holding: no posture"
    robot.update(10**9, "tracking", BODY, reference_posture("arms"), SURE)
    assert not robot.at(2 * 10**9).positions.any()


def two_arms(path: Path, head: str = "", left: str = "") -> Path:
    """Write a robot with the example arm twice; ``left`` is the origin of the left one."""
    text = ROBOT.urdf
    names = [*(f'"{link}"' for link in ROBOT.links if link != "base_link")]
    names += [f'"{name}"' for name in ROBOT.joints]
    body = text[text.index("<joint") : text.rindex("</robot>")]
    arms = []
    for side in ("left", "right"):
        part = body
        for name in names:
            part = part.replace(name, f'"{side}_{name[1:]}')
        if side == "left" and left:
            limits = 'lower="-2.8" upper="0.5"'
            part = part.replace("0 -0.16 0", left, 1).replace(limits, 'lower="-0.5" upper="2.8"')
        arms.append(part)
    path.write_text(f'<robot name="two"><link name="base_link"/>{"".join(arms)}{head}</robot>')
    return path


@pytest.mark.parametrize("apart_m", [0.0, 0.15])
def test_two_arms_do_not_touch_and_part_again(tmp_path: Path, apart_m: float) -> None:
    """Forearms that cross before the chest come as near as they may, and leave each other."""
    path = two_arms(tmp_path / "two.urdf", left="0 0.16 0")
    config = RetargetConfig(side="both", arms_apart_m=apart_m, soft_start_s=0.0)
    _, robot, _ = make_retargeter(path, None, config)
    crossed = np.zeros(12)
    for side in ("left", "right"):
        crossed[JOINT_NAMES.index(f"{side}_elbow_flexion")] = 0.7
        crossed[JOINT_NAMES.index(f"{side}_elbow_abduction")] = -1.3
    seen = []
    for tenth, posture in enumerate([*[crossed] * 30, *[np.zeros(12)] * 30]):
        robot.update(tenth * 10**8, "tracking", BODY, posture, SURE)
        for count in range(10):
            positions = robot.at(tenth * 10**8 + count * 10**7).positions
            seen.append(robot._method._between_m(positions))  # type: ignore[attr-defined]
    assert (min(seen) < 0.1) == (apart_m == 0.0)
    assert min(seen) >= apart_m - 0.01
    assert seen[-1] > 0.25


def test_the_rest_may_be_of_both_arms(tmp_path: Path) -> None:
    """The free turn of each straight arm goes to its own rest."""
    path = two_arms(tmp_path / "two.urdf")
    rest = "left_wrist_roll=1,right_wrist_roll=-1"
    _, robot, _ = make_retargeter(path, None, RetargetConfig(side="both", rest=rest))
    found = np.zeros(len(robot.joints))
    for _ in range(8):
        found = robot._method.target(BODY, np.append(np.zeros(12), [np.nan] * 4), found)
    rolls = [found[robot.joints.index(f"{side}_wrist_roll")] for side in ("left", "right")]
    assert rolls == pytest.approx([1.0, -1.0], abs=0.05)
    with pytest.raises(CardboxError, match="'wrist_roll=1' is not JOINT=VALUE"):
        make_retargeter(path, None, RetargetConfig(side="both", rest="wrist_roll=1"))


def test_two_arms_of_one_robot_follow_at_once(tmp_path: Path) -> None:
    """Each arm is the example arm, by its names."""
    joint = (
        '<link name="{link}"/><joint name="{name}" type="revolute"><parent link="{parent}"/>'
        '<child link="{link}"/><origin rpy="0 0 {yaw}"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" velocity="9" effort="1"/></joint>'
    )
    # Turned by half a turn, the second joint lifts the face by positive angles.
    head = joint.format(link="neck", name="pan", parent="base_link", yaw=0, axis="0 0 1")
    head += joint.format(link="head", name="tilt", parent="neck", yaw=np.pi, axis="0 1 0")
    path = two_arms(tmp_path / "two.urdf", head)
    _, robot, table = make_retargeter(path, None, RetargetConfig(side="both"))
    arm_joints = (f"{side}_{name}" for side in ("left", "right") for name in ROBOT.joints)
    assert robot.joints == (*arm_joints, "pan", "tilt")
    nods = robot._method.target(
        BODY, np.array([*np.zeros(12), 0.3, 0.2, np.nan, np.nan]), np.zeros(16)
    )  # type: ignore[attr-defined]
    assert nods[-2:].tolist() == [0.3, -0.2]
    assert "left_shoulder_roll" in table and "right_shoulder_roll" in table
    follow(robot, 10)
    assert robot.at(9 * 10**8).velocities[[0, 7]].all()
    with pytest.raises(CardboxError, match="the robot has one arm"):
        make_retargeter(CONFIG / "example_arm.urdf", None, RetargetConfig(side="both"))
