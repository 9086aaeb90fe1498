"""Nothing is sent that was not enabled, and what is sent never jumps."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.retargeter import Command, Retargeter
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.applications.retargeting.supervisor import DEAD_MAN_NS, Phase, Supervisor
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import reference_posture

CONFIG = Path(__file__).parents[3] / "config"
ROBOT = load_robot(CONFIG / "example_arm.urdf")
MAP = load_joint_map(CONFIG / "example_joint_map.yaml")
BODY = body_from_proportions(1.75, 2.0)
STEP_NS = 20_000_000


class Bench:
    """A robot that moves as it is told, a clock, and everything that was sent.

    Attributes:
        is_blocked: whether the robot stays where it is.
    """

    def __init__(self, config: RetargetConfig | None = None) -> None:
        self.config = config or RetargetConfig()
        self.retargeter = Retargeter(ROBOT, MAP, self.config)
        self.supervisor = Supervisor(self.retargeter, self.config, timeout_s=0.5)
        self.now_ns, self.stamp_ns = 10**9, 0
        self.robot = np.full(7, 0.04)
        self.sent: list[tuple[int, np.ndarray]] = []
        self.is_blocked = False

    def posture(
        self, state: str = "tracking", stamp_step_ns: int = STEP_NS, posture: str = "arms"
    ) -> Command | None:
        self.stamp_ns += stamp_step_ns
        seen = state in ("tracking", "uncertain")
        given = (reference_posture(posture), np.full(12, 0.1)) if seen else (None, None)
        update = partial(self.retargeter.update, self.stamp_ns, state, BODY, *given)
        return self.supervisor.follow(update, state, self.now_ns)

    def step(self, states: bool = True) -> None:
        """Let a fiftieth of a second pass."""
        self.now_ns += STEP_NS
        if states:
            self.supervisor.robot_at(self.robot, self.now_ns)
        self.supervisor.tick(self.now_ns)
        moment = self.supervisor.moment(self.now_ns)
        if moment is not None:
            if not self.is_blocked:
                self.robot = moment.positions
            self.sent.append((self.now_ns, moment.positions))

    def run(self, steps: int, state: str = "tracking", states: bool = True) -> None:
        for _ in range(steps):
            self.step(states)
            self.posture(state)


EVENTS = (
    *("step", "tracking", "uncertain", "lost", "jump", "silent", "on", "off", "grip", "moved"),
    *("blocked", "free"),
)
# The limit of the following error, and a tenth of a second at full speed to stop.
FARTHEST_RAD = 0.2 + 0.1 + 2 * STEP_NS / 1e9


# One that could not move is enabled anew as soon as it has been stopped.
STOPPED = [("grip", 1), ("tracking", 2), ("blocked", 1), ("step", 16), ("on", 1), ("tracking", 6)]


@given(st.lists(st.tuples(st.sampled_from(EVENTS), st.integers(1, 30)), max_size=40))
@example(STOPPED)
def test_no_sequence_makes_it_jump_or_send_what_was_not_enabled(
    events: list[tuple[str, int]],
) -> None:
    bench = Bench(RetargetConfig(enable_after_lost=len(events) % 2 == 0))
    enabled_ns = -(10**12)
    limits = ROBOT.limits_of(MAP.joints)
    for event, count in events:
        for _ in range(count if event in ("step", "tracking", "silent") else 1):
            before = len(bench.sent), bench.robot, bench.supervisor.phase
            if event in ("on", "off"):
                bench.supervisor.enable(event == "on", bench.now_ns)
            elif event == "grip":
                bench.supervisor.enable(True, bench.now_ns, is_grip=True)
            elif event == "moved" and (not bench.sent or bench.sent[-1][0] < bench.now_ns):
                bench.robot = np.clip(bench.robot + 0.1, *limits[:2])
            elif event in ("blocked", "free"):
                bench.is_blocked = event == "blocked"
            elif event == "jump":
                bench.posture("tracking", 3600 * 10**9)
            elif event in ("tracking", "uncertain", "lost"):
                bench.posture(event)
            bench.step(states=event != "silent")
            if bench.supervisor._is_wanted:
                enabled_ns = bench.now_ns
            if len(bench.sent) > before[0]:
                # From the command before, or where it begins, from the robot.
                origins = [before[1], *(positions for _, positions in bench.sent[-2:-1])]
                moved = [np.abs(bench.sent[-1][1] - origin).max() for origin in origins]
                assert min(moved) <= 1.0 * STEP_NS / 1e9 + 1e-9
                # One that cannot move is not left far behind.
                assert np.abs(bench.sent[-1][1] - bench.robot).max() <= FARTHEST_RAD
                assert bench.now_ns - enabled_ns <= bench.retargeter.settles_ns + STEP_NS
    times = np.array([time for time, _ in bench.sent])
    way = np.array([positions for _, positions in bench.sent]).reshape(-1, 7)
    # Between two moments that are neighbours, speed changes by no more than the acceleration.
    near = np.diff(times) == STEP_NS
    speeds = np.diff(way, axis=0) / (STEP_NS / 1e9)
    both = near[1:] & near[:-1]
    changes = np.abs(np.diff(speeds, axis=0))[both]
    assert (changes <= 20.0 * bench.config.max_speed * STEP_NS / 1e9 + 1e-6).all()


def test_it_begins_where_the_robot_is_and_stops_slowly() -> None:
    bench = Bench()
    bench.run(20)
    assert not bench.sent and bench.supervisor.status == "disabled"
    bench.supervisor.enable(True, bench.now_ns)
    assert bench.supervisor.phase is Phase.READY
    bench.run(1, "lost")
    assert not bench.sent and bench.supervisor.status == "ready: lost"
    bench.run(60)
    assert bench.sent[0][1].tolist() == [0.04] * 7
    assert bench.supervisor.status == "following"
    assert bench.robot[0] < -0.2
    bench.supervisor.enable(False, bench.now_ns)
    assert bench.supervisor.phase is Phase.DISABLED
    sent = len(bench.sent)
    bench.run(30)
    stopping = len(bench.sent) - sent
    assert stopping == pytest.approx(bench.retargeter.settles_ns / STEP_NS, abs=1.5)


def test_without_the_robots_joint_states_nothing_is_sent() -> None:
    bench = Bench()
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(50, states=False)
    assert not bench.sent
    assert bench.supervisor.status == "ready: the robot's joint states are not known"
    bench.run(50)
    assert bench.supervisor.status == "following"
    bench.run(60, states=False)
    sent = len(bench.sent)
    bench.run(50)
    assert bench.supervisor.status == "faulted: the robot's joint states have stopped"
    bench.supervisor.enable(True, bench.now_ns)
    bench.robot = np.full(7, 0.01)  # it was moved by hand meanwhile
    bench.run(3)
    assert bench.sent[sent][1].tolist() == [0.01] * 7
    told = Bench(RetargetConfig(start="shoulder_roll=0"))
    told.supervisor.enable(True, told.now_ns)
    told.run(5, states=False)
    assert told.sent


def test_a_grip_lasts_as_long_as_it_is_repeated() -> None:
    bench = Bench()
    for _ in range(50):
        bench.supervisor.enable(True, bench.now_ns, is_grip=True)
        bench.run(1)
    assert bench.supervisor.phase is Phase.FOLLOWING
    bench.run(DEAD_MAN_NS // STEP_NS + 1)
    assert bench.supervisor.status == "disabled: not gripped"


def test_a_grip_that_is_held_enables_nothing_after_a_fault() -> None:
    bench = Bench()
    for state in (*["tracking"] * 50, *["lost"] * 40, *["tracking"] * 50):
        bench.supervisor.enable(True, bench.now_ns, is_grip=True)
        bench.run(1, state)
    assert bench.supervisor.status == "faulted: lost"
    bench.supervisor.enable(False, bench.now_ns, is_grip=True)
    bench.supervisor.enable(True, bench.now_ns, is_grip=True)
    bench.run(3)
    assert bench.supervisor.phase is Phase.FOLLOWING


def following(**settings: Any) -> Bench:
    """Return a bench whose robot follows."""
    bench = Bench(RetargetConfig(**settings))
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(50)
    assert bench.supervisor.phase is Phase.FOLLOWING
    return bench


@pytest.mark.parametrize("again", [False, True])
@pytest.mark.parametrize("lost", ["lost", "no_person", "silence"])
def test_after_a_loss_it_goes_on_unless_it_has_to_be_enabled(lost: str, again: bool) -> None:
    bench = following(enable_after_lost=again)
    for _ in range(40):
        bench.step()
        if lost != "silence":
            bench.posture(lost)
    word = {"silence": "no posture for 0.5 s"}.get(lost, lost.replace("_", " "))
    assert bench.supervisor.status == f"{'faulted' if again else 'holding'}: {word}"
    assert np.ptp([positions[0] for _, positions in bench.sent[-10:]]) == 0.0
    bench.run(5)
    assert bench.supervisor.phase is (Phase.FAULTED if again else Phase.FOLLOWING)


def test_a_short_loss_holds_and_goes_on() -> None:
    bench = following()
    bench.run(20, "lost")
    assert bench.supervisor.status == "holding: lost"
    bench.run(5)
    assert bench.supervisor.status == "following"


STEP_RAD = 1.0 * STEP_NS / 1e9 + 1e-9


def steps(bench: Bench, since: int = 0) -> np.ndarray:
    """Return how far each command is from the one before."""
    return np.abs(np.diff([positions for _, positions in bench.sent[since:]], axis=0)).max(axis=1)


def test_a_blocked_robot_is_held_near_and_does_not_jump_on_release() -> None:
    bench = following()
    bench.is_blocked, sent = True, len(bench.sent)
    statuses = set()
    for _ in range(500):
        bench.run(1)
        statuses.add(bench.supervisor.status)
    # It is tried again and again, slowly.
    assert statuses == {"following", "holding: shoulder_roll is not where it was sent"}
    most = bench.config.max_following_error
    off = np.abs([positions - bench.robot for _, positions in bench.sent[sent:]]).max(axis=1)
    # A robot that is at its speed needs half of the time to settle to stop.
    assert off.max() <= most + bench.retargeter.settles_ns / 2e9 * 1.0 + STEP_RAD
    # It does not press all the time.
    assert off[-100:].min() <= most / 2
    bench.is_blocked = False
    bench.run(103)
    assert bench.supervisor.status == "following"
    assert steps(bench).max() <= STEP_RAD
    assert bench.robot[0] < -1.0


def test_a_robot_that_is_moved_elsewhere_is_not_pulled_back() -> None:
    bench = following()
    bench.run(50)
    bench.is_blocked, sent = True, len(bench.sent)
    bench.robot = bench.robot + np.array([1.0, *[0.0] * 6])
    bench.run(200)
    assert steps(bench).max() <= STEP_RAD
    off = np.abs(bench.sent[-1][1] - bench.robot).max()
    assert off <= bench.config.max_following_error + STEP_RAD
    bench.is_blocked = False
    bench.run(20)
    assert bench.supervisor.phase is Phase.FOLLOWING
    assert steps(bench, sent).max() <= STEP_RAD


def test_a_robot_that_presses_on_something_is_led_away_from_it() -> None:
    bench, wall = following(), -0.7
    for arms in ("arms",) * 200 + ("front",) * 150:
        bench.step()
        # The arm stretched aside turns the first joint on against the wall.
        bench.robot = np.array([max(bench.robot[0], wall), *bench.robot[1:]])
        bench.posture(posture=arms)
    # Until then it was held with its command beyond the wall.
    assert min(positions[0] for _, positions in bench.sent) < wall - 0.1
    assert bench.supervisor.status == "following"
    assert bench.robot[0] > wall + 0.2


def test_a_gripper_may_be_stopped_by_what_it_holds(tmp_path: Path) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(
        "joints: [{from: right_shoulder_flexion, to: shoulder_pitch}, "
        "{from: right_hand_open, to: wrist_roll}]"
    )
    tolerance = Retargeter(ROBOT, load_joint_map(path), RetargetConfig()).tolerance
    assert tolerance.tolist() == [0.2, np.inf]


def test_a_robot_beyond_its_limits_is_not_begun_with() -> None:
    bench = Bench()
    bench.robot = np.full(7, 9.0)
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(5)
    assert not bench.sent and bench.supervisor.status.endswith("is beyond its limits")


@pytest.mark.parametrize("stall_s", [0.35, 0.5])
def test_after_a_stall_of_the_node_no_command_is_farther_than_a_step(stall_s: float) -> None:
    bench = following()
    bench.posture()  # whose movement goes on while the node stands still
    bench.now_ns += round(stall_s * 1e9)
    bench.run(3)
    assert steps(bench).max() <= STEP_RAD


def test_ticks_that_are_late_in_turn_make_no_robot_slower() -> None:
    ways = []
    for late_ns in (0, 8_000_000):
        bench = following()
        for number in range(20):
            bench.now_ns += late_ns if number % 2 == 0 else -late_ns
            bench.step()
            bench.posture()
        assert steps(bench).max() <= STEP_RAD
        ways.append(bench.robot)
    assert np.abs(np.subtract(*ways)).max() <= STEP_RAD
    assert np.abs(ways[0] - 0.04).max() > 10 * STEP_RAD


def test_a_clock_that_is_set_back_moves_nothing_by_itself() -> None:
    bench = following()
    bench.stamp_ns -= 3600 * 10**9
    bench.run(100)
    assert steps(bench).max() <= STEP_RAD and bench.supervisor.phase is Phase.FOLLOWING
