"""Whatever is measured, a robot keeps its limits and speeds, and stands still when it must."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.retargeter import Limits, Retargeter, SafeMotion
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.proportions import body_from_proportions
from cardbox_tracker.person.skeleton import JOINT_NAMES

CONFIG = Path(__file__).parents[3] / "config"
ROBOT = load_robot(CONFIG / "example_arm.urdf")
MAP = load_joint_map(CONFIG / "example_joint_map.yaml")
BODY = body_from_proportions(1.75, 2.0)
SURE = np.full(12, 0.1)
PERIOD_NS = 66_666_667

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
    max_stddev_rad=st.floats(0.05, 3.2),
    longest_step_s=st.floats(0.01, 1),
)


@given(images, st.lists(st.integers(0, 10**9), min_size=12, max_size=12), settings)
def test_limits_and_speeds_hold_for_any_input(
    sequence: list[tuple[int, str, np.ndarray | None, np.ndarray | None]],
    waits_ns: list[int],
    config: RetargetConfig,
) -> None:
    robot = Retargeter(ROBOT, MAP, config)
    lower, upper, speed = ROBOT.limits_of(MAP.joints)
    most = np.minimum(speed, config.max_speed)
    before, stamp_ns, now_ns = robot.at(0).positions, 0, 0
    for (step_ns, state, posture, stddev), wait_ns in zip(sequence, waits_ns, strict=False):
        stamp_ns, now_ns = stamp_ns + step_ns, now_ns + wait_ns
        found = robot.at(now_ns)
        assert (np.abs(found.positions - before) <= most * wait_ns / 1e9 + 1e-9).all()
        command = robot.update(stamp_ns, state, BODY, posture, stddev, now_ns)
        assert robot.at(now_ns).positions == pytest.approx(found.positions, abs=1e-12)
        for positions, velocities in (robot.at(now_ns), robot.at(now_ns + 10**7)):
            assert (positions >= lower).all() and (positions <= upper).all()
            assert (np.abs(velocities) <= most * (1 + 1e-6)).all()
        # Never for longer than the time that really passed, nor than the longest step.
        assert command.duration_s <= min(wait_ns / 1e9, config.longest_step_s) + 1e-9
        if state != "tracking" or posture is None or stddev is None:
            assert not command.is_moving
        if not command.is_moving:
            assert (robot.at(now_ns + 10**9).positions == command.positions).all()
            assert not robot.at(now_ns).velocities.any()
        before = found.positions


@given(
    st.lists(st.lists(numbers, min_size=2, max_size=2), max_size=10),
    st.lists(st.integers(-(10**9), 10**11), min_size=10, max_size=10),
)
def test_the_last_step_holds_for_any_target(
    targets: list[list[float]], times_ns: list[int]
) -> None:
    limits = Limits(np.array([-1.0, 0.5]), np.array([2.0, 0.75]), np.array([1.0, math.inf]))
    motion = SafeMotion(limits)
    for target, time_ns in zip(targets, times_ns, strict=False):
        before = motion.goal
        after = motion.move(np.array(target), 0, time_ns)
        assert (after >= limits.lower).all() and (after <= limits.upper).all()
        assert abs(after[0] - before[0]) <= max(time_ns / 1e9, 0.0) + 1e-12
        motion.stop(max(time_ns, 0))


def test_between_two_images_the_arm_moves_evenly() -> None:
    """From -0.1 to -0.2 rad in 100 ms, at 1 rad/s; a stop on the way is at once."""
    robot = Retargeter(ROBOT, MAP, RetargetConfig(max_speed=1.0))
    for tenth in range(3):
        robot.update(tenth * 10**8, "tracking", BODY, reference_posture("arms"), SURE)
    way = [robot.at(200_000_000 + 20_000_000 * step) for step in range(7)]
    roll = [moment.positions[0] for moment in way]
    assert roll == pytest.approx([-0.1, -0.12, -0.14, -0.16, -0.18, -0.2, -0.2])
    assert [moment.velocities[0] for moment in way] == pytest.approx([-1.0] * 5 + [0.0] * 2)
    stopped = robot.hold("lost", 250_000_000)
    assert stopped.positions[0] == pytest.approx(-0.15)
    assert robot.at(10**9).positions[0] == pytest.approx(-0.15)


def test_an_early_image_goes_on_from_where_the_arm_is() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(max_speed=1.0))
    for stamp_ns in (0, 10**8, 15 * 10**7):
        command = robot.update(stamp_ns, "tracking", BODY, reference_posture("arms"), SURE)
    assert robot.at(15 * 10**7).positions[0] == pytest.approx(-0.05)
    assert command.positions[0] == pytest.approx(-0.1)


def test_an_arm_gets_where_it_is_wanted_at_its_speed() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig(max_speed=1.0))
    posture = reference_posture("arms")  # abduction 80 degrees
    positions = [
        robot.update(i * 10**8, "tracking", BODY, posture, SURE).positions for i in range(20)
    ]
    assert positions[0] == pytest.approx([0.0] * 7)
    assert positions[5] == pytest.approx([-0.5, *[0.0] * 6])
    assert positions[-1] == pytest.approx([-math.radians(80), *[0.0] * 6])


@pytest.mark.parametrize(
    ("state", "deviation", "status"),
    [
        ("lost", 0.1, "frozen: lost"),
        ("no_person", 0.1, "frozen: no person"),
        ("uncertain", 0.1, "frozen: uncertain"),
        ("", 0.1, "frozen: no state yet"),
        ("tracking", 0.8, "frozen: too uncertain"),
        ("tracking", math.nan, "frozen: too uncertain"),
        ("tracking", 0.1, "moving"),
    ],
)
def test_the_dead_man(state: str, deviation: float, status: str) -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig())
    posture = reference_posture("arms")
    robot.update(0, "tracking", BODY, posture, SURE)
    before = robot.update(PERIOD_NS, "tracking", BODY, posture, SURE).positions
    stddev = SURE.copy()
    stddev[JOINT_NAMES.index("right_elbow_flexion")] = deviation
    command = robot.update(2 * PERIOD_NS, state, BODY, posture, stddev)
    assert command.status == status
    assert (command.positions == before).all() == (status != "moving")


def test_what_is_not_followed_may_be_uncertain() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig())
    stddev = SURE.copy()
    stddev[JOINT_NAMES.index("left_elbow_flexion")] = 3.0
    assert robot.update(0, "tracking", BODY, reference_posture("arms"), stddev).is_moving


def test_after_holding_nothing_is_made_up_for() -> None:
    robot = Retargeter(ROBOT, MAP, RetargetConfig())
    posture = reference_posture("arms")
    before = robot.update(0, "tracking", BODY, posture, SURE).positions
    assert robot.hold("no posture", 10**8).status == "frozen: no posture"
    assert (robot.update(10**9, "tracking", BODY, posture, SURE).positions == before).all()
