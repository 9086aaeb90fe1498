"""The node ``retarget`` commands a robot only while the posture is certain."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String

from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.ros.nodes import retarget_node
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode

CONFIG = Path(__file__).parents[3] / "config"
MODEL = String(data=dumps_body_model(body_from_proportions(1.75, 2.0, 0.4, 0.0)))
ARM = CONFIG / "example_arm.urdf"
COMMANDS, SAID = "/retarget/commands", "/retarget/status"


class Clock:
    """Replaces the monotonic clock."""

    now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "monotonic", made.monotonic)
    return made


START = "shoulder_roll=0.1"


@pytest.fixture
def start(bus: Any, clock: Clock) -> Callable[..., Any]:
    """Return a function that starts a node which moves an arm, and enables it."""

    def begin(**parameters: Any) -> Any:
        given = {"joint_map_file": str(CONFIG / "example_joint_map.yaml"), **parameters}
        node = bus.start(RetargetNode, robot_file=str(ARM), soft_start_s=0.0, **given)
        bus.send("/body_model", MODEL)
        node._supervisor.enable(True, int(clock.now_s * 1e9))
        return node

    return begin


@pytest.fixture
def robot(bus: Any, start: Any) -> Any:
    """Return the bus of a node that moves an arm from a known start."""
    start(start=START)
    return bus


@pytest.fixture
def send(bus: Any, joints: Any, clock: Clock) -> Callable[..., None]:
    """Return a function that sends the tracker's messages of one image, after some time."""

    def hand_over(
        tenth: int, state: str = "tracking", deviation: float = 0.1, after_s: float = 0.1
    ) -> None:
        for _ in range(4):
            clock.now_s += after_s / 5
            bus.tick()
        clock.now_s += after_s / 5
        bus.send("/tracking_state", String(data=state))
        bus.send("/joint_states", joints(tenth, {"right_shoulder_abduction": 1.0}))
        bus.send("/joint_states_stddev", joints(tenth, {}, other=deviation))
        bus.tick()

    return hand_over


def test_an_arm_moves_at_its_speed_and_decelerates_when_the_person_is_lost(
    robot: Any, send: Any, clock: Clock
) -> None:
    for tenth in range(6):
        send(tenth)
    moved = positions(robot)[:, 0]
    assert moved[0] == 0.1
    assert np.diff(moved)[-1] == pytest.approx(-0.02)
    robot.send("/tracking_state", String(data="lost"))
    for _ in range(15):
        clock.now_s += 0.02
        robot.tick()
    assert robot.texts(SAID) == ["disabled", "ready: no posture yet", "following", "holding: lost"]
    stopping = positions(robot)[len(moved) :, 0]
    assert (np.abs(np.diff(stopping)) <= 0.02 + 1e-9).all()
    assert np.ptp(stopping[-3:]) < 1e-9 and stopping[-1] < moved[-1]
    last = robot.sent["/retarget/joint_trajectory"][-1]
    assert last.joint_names == list(load_robot(ARM).joints)
    assert last.points[0].positions[0] == pytest.approx(stopping[-1])
    assert (last.header.stamp.sec, last.header.stamp.nanosec) == (0, 0)


def test_nothing_is_sent_before_all_is_known(bus: Any, start: Any, send: Any, clock: Clock) -> None:
    node = start()
    assert node._supervisor.phase.value == "ready"
    for tenth in range(5):
        send(tenth)
    bus.send("/retarget/robot_joint_states", JointState(name=["elbow_pitch"], position=[0.5]))
    send(5)
    assert not bus.sent[COMMANDS] and not bus.sent["/retarget/joint_trajectory"]
    assert bus.texts(SAID)[-1] == "ready: the robot's joint states are not known"
    names = list(load_robot(ARM).joints)
    where = JointState(name=names[::-1], position=[0.0] * 6 + [-0.2])
    bus.send("/retarget/robot_joint_states", where)
    send(6)
    assert positions(bus).tolist() == [[-0.2, *[0.0] * 6]]


def test_stamps_rise_whatever_the_latency_and_the_clock_of_the_images(
    robot: Any, send: Any, clock: Clock
) -> None:
    for tenth, after_s in ((0, 0.1), (1, 0.1), (2, 0.1), (3, 0.18), (4, 0.02), (0, 0.1), (1, 0.1)):
        send(tenth, after_s=after_s)
    sent = robot.sent["/retarget/joint_states"]
    stamps = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in sent])
    assert len(stamps) > 25 and (np.diff(stamps) > 1e-3).all()
    # They are those of the images' clock.
    assert abs(stamps[0] - 1.0) < 0.02


def test_the_time_from_the_image_to_the_command_is_a_diagnostic(
    bus: Any, start: Any, send: Any, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = start(start=START)
    monkeypatch.setattr(node, "get_clock", lambda: SimpleNamespace(now=lambda: Time(seconds=1.45)))
    for tenth in range(5):
        send(tenth)

    def told() -> dict[str, str]:
        return {one.key: one.value for one in node.diagnostics.status().values}

    # The stamps are 1.0 to 1.4 s; 95 % of the times are within 50 to 450 ms.
    assert told()["image to command p95 (ms)"] == "430.0"
    monkeypatch.setattr(node, "get_clock", lambda: SimpleNamespace(now=lambda: Time(seconds=99)))
    send(5)
    assert "image to command p95 (ms)" not in told()


def test_only_what_may_be_sent_is_streamed(
    bus: Any, start: Any, send: Any, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[dict[str, Any]] = []
    keep = lambda one: sent.append(json.loads(one))  # noqa: E731
    sender = SimpleNamespace(send=keep, close=lambda: None, remarks=())
    monkeypatch.setattr(retarget_node, "ZmqSender", lambda _: sender)
    node = start(start=START, stream_address="tcp://127.0.0.1:5557")
    node._supervisor.enable(False, int(clock.now_s * 1e9))
    send(0)
    assert not sent
    node._supervisor.enable(True, int(clock.now_s * 1e9))
    for tenth in range(1, 4):
        send(tenth)
    found = np.array([one["positions"] for one in sent])
    assert found == pytest.approx(positions(bus), abs=1e-6)
    assert sent[0]["names"] == list(load_robot(ARM).joints)


def test_a_grip_enables_while_it_is_repeated(bus: Any, start: Any, send: Any, clock: Clock) -> None:
    node = start(start=START)
    node._supervisor.enable(False, int(clock.now_s * 1e9))
    for tenth in range(3):
        send(tenth)
    assert not bus.sent[COMMANDS]
    for tenth in range(3, 6):
        bus.send("/retarget/grip", Bool(data=True), time.time_ns())
        send(tenth)
    assert bus.texts(SAID)[-1] == "following"
    for tenth in range(6, 12):
        send(tenth)
        if tenth == 11:
            # One that was long on its way enables nothing.
            bus.send("/retarget/grip", Bool(data=True), time.time_ns() - 400_000_000)
    assert bus.texts(SAID)[-2:] == ["following", "disabled: not gripped"]
    sent = len(bus.sent[COMMANDS])
    send(12)
    assert len(bus.sent[COMMANDS]) == sent


def test_an_uncertain_posture_moves_nothing(robot: Any, send: Any) -> None:
    for tenth in range(2):
        send(tenth, deviation=2.0)
    send(2, state="uncertain")
    assert not robot.sent[COMMANDS]
    assert robot.texts(SAID)[2:] == ["ready: too uncertain", "ready: uncertain"]


def test_without_a_body_model_nothing_is_sent_and_the_node_says_why(
    bus: Any, clock: Clock, send: Any
) -> None:
    joint_map = str(CONFIG / "example_joint_map.yaml")
    node = bus.start(RetargetNode, robot_file=str(ARM), joint_map_file=joint_map, start=START)
    node._supervisor.enable(True, int(clock.now_s * 1e9))
    for tenth in range(2):
        send(tenth)
    assert bus.texts(SAID)[-1] == "ready: no body model"
    assert (
        "the body model on /body_model; the node initializer" in node.diagnostics.status().message
    )
    bus.send("/body_model", MODEL)
    send(2)
    assert bus.texts(SAID)[-1] == "following"
    assert "body model" not in node.diagnostics.status().message


def test_silence_is_a_dead_man_too(robot: Any, send: Any, clock: Clock) -> None:
    send(0)
    assert robot.texts(SAID)[-1] == "following"
    clock.now_s += 1.0
    robot.tick()
    assert robot.texts(SAID)[-1] == "faulted: no posture for 0.5 s"


def test_positions_by_name_have_velocities_and_stamps_that_go_on(
    robot: Any, send: Any, clock: Clock
) -> None:
    for tenth in range(8):
        send(tenth)
    robot.sent["/retarget/joint_states"].clear()
    for _ in range(4):
        clock.now_s += 0.02
        robot.tick()
    sent = robot.sent["/retarget/joint_states"]
    assert np.diff([message.position[0] for message in sent]) == pytest.approx([-0.02] * 3)
    assert [message.velocity[0] for message in sent] == pytest.approx([-1.0] * 4)
    seconds = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in sent]
    assert np.diff(seconds) == pytest.approx([0.02] * 3)


def test_the_rate_is_a_parameter(bus: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    periods: list[float] = []
    monkeypatch.setattr(
        RetargetNode, "create_timer", lambda _, period_s, *__, **___: periods.append(period_s)
    )
    joint_map = str(CONFIG / "example_joint_map.yaml")
    bus.start(RetargetNode, robot_file=str(ARM), joint_map_file=joint_map, rate_hz=200.0)
    assert 1 / 200 in periods


STAYS = "An arm stops with its input and stays where it is; no stamp makes it faster"


def positions(robot: Any) -> np.ndarray:
    """Return all commanded positions (n, 7)."""
    return np.array([data.tolist() for data in robot.texts(COMMANDS)])


@pytest.mark.promise(STAYS)
@pytest.mark.parametrize("is_repeated", [False, True])
def test_an_arm_stops_with_its_input_and_stays(
    robot: Any, send: Any, clock: Clock, is_repeated: bool
) -> None:
    for tenth in range(8):
        send(tenth)
    (point,) = robot.sent["/retarget/joint_trajectory"][-1].points
    reached_s = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
    assert reached_s <= 0.1 + 1e-9
    for count in range(600):
        if is_repeated:
            send(7)  # the last image again and again
        else:
            clock.now_s += 0.1
        robot.tick()
        if count == 30:
            stopped = positions(robot)[-1]
    assert (positions(robot)[-1] == stopped).all()
    assert robot.texts(SAID)[-1] == "faulted: no posture for 0.5 s"
    sent = len(robot.sent[COMMANDS])
    for tenth in range(700, 710):
        send(tenth)
    assert len(robot.sent[COMMANDS]) == sent


@pytest.mark.promise(STAYS)
@pytest.mark.parametrize(
    "tenths",
    [
        [0, *range(10, 1000, 10)],  # each stamp is a second later
        [10_000 * (i % 2) + i for i in range(100)],  # two clocks, 1,000 s apart
        [10_000 - i for i in range(100)],
        [2 * i for i in range(100)],  # a clock that is 60 times too fast
        [5] * 100,
    ],
)
def test_no_stamp_makes_an_arm_faster(
    robot: Any, send: Any, clock: Clock, tenths: list[int]
) -> None:
    began_s = clock.now_s
    for tenth in tenths:
        send(tenth, after_s=1 / 300)
        assert np.abs(positions(robot)[-1]).max() <= 0.1 + clock.now_s - began_s + 1e-9


def test_a_node_without_a_robot_does_not_start(bus: Any, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="robot_file"):
        bus.start(RetargetNode)
    with pytest.raises(CardboxError, match="No such file"):
        bus.start(RetargetNode, robot_file=str(tmp_path / "arm.urdf"))


def test_a_gripper_follows_the_hand_of_the_same_image(
    bus: Any, start: Any, clock: Clock, joints: Any, tmp_path: Path
) -> None:
    joint_map = tmp_path / "map.yaml"
    joint_map.write_text("joints: [{from: right_hand_open, to: wrist_roll, scale: 0.2}]")
    start(joint_map_file=str(joint_map), start="wrist_roll=0")
    bus.tick()
    for tenth in range(12):
        bus.send("/tracking_state", String(data="tracking"))
        bus.send("/joint_states", joints(tenth, {}))
        if tenth < 3:
            header = joints(tenth, {}).header
            bus.send("/hands", JointState(header=header, name=["right_hand_open"], position=[1.0]))
        bus.send("/joint_states_stddev", joints(tenth, {}, other=0.1))
        for _ in range(5):
            clock.now_s += 0.02
            bus.tick()
    goals = [one.points[0].positions[0] for one in bus.sent["/retarget/joint_trajectory"]]
    # The robot moves by its speed, and stays where it is without a hand.
    assert goals[0] == 0.0 and 0.0 < goals[1] < goals[2]
    assert goals[-1] == pytest.approx(0.2) == goals[-2]
