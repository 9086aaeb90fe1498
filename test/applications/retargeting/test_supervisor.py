"""Nothing is sent that was not enabled, and what is sent never jumps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
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
    """A robot that moves as it is told, a clock, and everything that was sent."""

    def __init__(self, config: RetargetConfig | None = None) -> None:
        self.config = config or RetargetConfig()
        self.retargeter = Retargeter(ROBOT, MAP, self.config)
        self.supervisor = Supervisor(self.retargeter, self.config, timeout_s=0.5)
        self.now_ns, self.stamp_ns = 10**9, 0
        self.robot = np.full(7, 0.04)
        self.sent: list[tuple[int, np.ndarray]] = []

    def posture(self, state: str = "tracking", stamp_step_ns: int = STEP_NS) -> Command | None:
        self.stamp_ns += stamp_step_ns
        posture, stddev = reference_posture("arms"), np.full(12, 0.1)

        def update() -> Command:
            seen = state in ("tracking", "uncertain")
            return self.retargeter.update(
                *(self.stamp_ns, state, BODY, posture if seen else None),
                *(stddev if seen else None, self.now_ns),
            )

        return self.supervisor.follow(update, state, self.now_ns)

    def step(self, states: bool = True) -> None:
        """Let a fiftieth of a second pass."""
        self.now_ns += STEP_NS
        if states:
            self.supervisor.robot_at(self.robot, self.now_ns)
        self.supervisor.tick(self.now_ns)
        moment = self.supervisor.moment(self.now_ns)
        if moment is not None:
            self.robot = moment.positions
            self.sent.append((self.now_ns, moment.positions))

    def run(self, steps: int, state: str = "tracking", states: bool = True) -> None:
        for _ in range(steps):
            self.step(states)
            self.posture(state)


EVENTS = ("step", "tracking", "uncertain", "lost", "jump", "silent", "on", "off", "grip", "moved")


@given(st.lists(st.tuples(st.sampled_from(EVENTS), st.integers(1, 30)), max_size=40))
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
            elif event == "moved" and bench.supervisor.phase in (Phase.DISABLED, Phase.READY):
                bench.robot = np.clip(bench.robot + 0.1, *limits[:2])
            elif event == "jump":
                bench.posture("tracking", 3600 * 10**9)
            elif event in ("tracking", "uncertain", "lost"):
                bench.posture(event)
            bench.step(states=event != "silent")
            if bench.supervisor._is_wanted:
                enabled_ns = bench.now_ns
            if len(bench.sent) > before[0]:
                moved = np.abs(bench.sent[-1][1] - before[1])
                assert (moved <= 1.0 * STEP_NS / 1e9 + 1e-9).all()
                assert bench.now_ns - enabled_ns <= bench.retargeter.settles_ns + STEP_NS
    times = np.array([time for time, _ in bench.sent])
    way = np.array([positions for _, positions in bench.sent]).reshape(-1, 7)
    # Between two moments that are neighbours, speed changes by no more than the acceleration.
    near = np.diff(times) == STEP_NS
    speeds = np.diff(way, axis=0) / (STEP_NS / 1e9)
    both = near[1:] & near[:-1]
    changes = np.abs(np.diff(speeds, axis=0))[both]
    assert (changes <= bench.config.max_acceleration * STEP_NS / 1e9 + 1e-6).all()


def test_it_begins_where_the_robot_is_and_stops_slowly() -> None:
    bench = Bench()
    bench.run(20)
    assert not bench.sent and bench.supervisor.status == "disabled"
    bench.supervisor.enable(True, bench.now_ns)
    assert bench.supervisor.phase is Phase.READY
    bench.run(1, "lost")
    assert not bench.sent and bench.supervisor.status == "ready: frozen: lost"
    bench.run(60)
    assert bench.sent[0][1].tolist() == [0.04] * 7
    assert bench.supervisor.status == "moving"
    assert bench.robot[0] < -0.2
    bench.supervisor.enable(False, bench.now_ns)
    assert bench.supervisor.phase is Phase.STOPPING
    sent = len(bench.sent)
    bench.run(30)
    assert bench.supervisor.phase is Phase.DISABLED
    stopping = len(bench.sent) - sent
    assert stopping == pytest.approx(bench.retargeter.settles_ns / STEP_NS, abs=1.5)


def test_without_the_robots_joint_states_nothing_is_sent() -> None:
    bench = Bench()
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(50, states=False)
    assert not bench.sent
    assert bench.supervisor.status == "ready: the robot's joint states are not known"
    bench.run(50)
    assert bench.supervisor.status == "moving"
    bench.run(60, states=False)
    sent = len(bench.sent)
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
    assert bench.supervisor.phase is Phase.STOPPING
    bench.run(30)
    assert bench.supervisor.status == "disabled: not gripped"


@pytest.mark.parametrize("again", [False, True])
def test_after_lost_it_goes_on_unless_it_has_to_be_enabled(again: bool) -> None:
    bench = Bench(RetargetConfig(enable_after_lost=again))
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(50)
    bench.run(30, "lost")
    bench.run(5)
    assert bench.supervisor.phase is (Phase.DISABLED if again else Phase.FOLLOWING)


def test_silence_stops_it() -> None:
    bench = Bench()
    bench.supervisor.enable(True, bench.now_ns)
    bench.run(50)
    for _ in range(60):
        bench.step()
    assert bench.supervisor.status == "frozen: no posture for 0.5 s"
    assert np.ptp([positions[0] for _, positions in bench.sent[-10:]]) == 0.0
