"""The node ``retarget`` commands a robot only while the posture is certain."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from cardbox_tracker.applications.retargeting.robot import load_robot  # noqa: E402
from cardbox_tracker.common.errors import CardboxError  # noqa: E402
from cardbox_tracker.person.model_file import dumps_body_model  # noqa: E402
from cardbox_tracker.person.proportions import body_from_proportions  # noqa: E402
from cardbox_tracker.ros.nodes.retarget_node import RetargetNode  # noqa: E402

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


@pytest.fixture
def robot(bus: Any, clock: Clock) -> Any:
    """Return the bus of a node that moves an arm."""
    joint_map = str(CONFIG / "example_joint_map.yaml")
    bus.start(RetargetNode, robot_file=str(ARM), joint_map_file=joint_map)
    bus.send("/body_model", MODEL)
    return bus


@pytest.fixture
def send(robot: Any, joints: Any, clock: Clock) -> Callable[..., None]:
    """Return a function that sends the tracker's messages of one image, after some time."""

    def hand_over(
        tenth: int, state: str = "tracking", deviation: float = 0.1, after_s: float = 0.1
    ) -> None:
        clock.now_s += after_s
        robot.send("/tracking_state", String(data=state))
        robot.send("/joint_states", joints(tenth, {"right_shoulder_abduction": 1.0}))
        robot.send("/joint_states_stddev", joints(tenth, {}, other=deviation))
        robot.tick()

    return hand_over


def test_an_arm_moves_at_its_speed_and_stops_when_the_person_is_lost(
    robot: Any, send: Any, clock: Clock
) -> None:
    for tenth in range(3):
        send(tenth)
    moved = np.array([data.tolist() for data in robot.texts(COMMANDS)])
    # The way of each image begins when it comes.
    np.testing.assert_allclose(moved[:, 0], [0, 0, -0.1], atol=1e-9)
    clock.now_s += 0.05
    robot.send("/tracking_state", String(data="lost"))
    robot.send("/tracking_state", String(data="lost"))
    assert robot.texts(SAID) == ["moving", "frozen: lost"]
    assert len(robot.sent[COMMANDS]) == 4  # the command to stand still is sent once
    assert robot.texts(COMMANDS)[-1].tolist() == pytest.approx([-0.15, *[0] * 6])
    last = robot.sent["/retarget/joint_trajectory"][-1]
    assert last.joint_names == list(load_robot(ARM).chain("hand_link"))
    assert last.points[0].positions.tolist() == pytest.approx([-0.15, *[0] * 6])
    assert (last.header.stamp.sec, last.header.stamp.nanosec) == (0, 0)


def test_an_uncertain_posture_moves_nothing(robot: Any, send: Any) -> None:
    send(0)
    send(1, deviation=2.0)
    send(2, state="uncertain")
    assert {tuple(data) for data in robot.texts(COMMANDS)} == {(0.0,) * 7}
    assert robot.texts(SAID) == ["moving", "frozen: too uncertain", "frozen: uncertain"]


def test_without_a_body_model_the_robot_stands_still_and_the_node_says_why(
    bus: Any, joints: Any
) -> None:
    joint_map = str(CONFIG / "example_joint_map.yaml")
    node = bus.start(RetargetNode, robot_file=str(ARM), joint_map_file=joint_map)
    for tenth in range(2):
        bus.send("/tracking_state", String(data="tracking"))
        bus.send("/joint_states", joints(tenth, {}))
        bus.send("/joint_states_stddev", joints(tenth, {}, other=0.1))
    assert bus.texts(SAID) == ["frozen: no body model"]
    assert (
        "the body model on /body_model; the node initializer" in node.diagnostics.status().message
    )
    bus.send("/body_model", MODEL)
    bus.send("/tracking_state", String(data="tracking"))
    bus.send("/joint_states", joints(2, {}))
    bus.send("/joint_states_stddev", joints(2, {}, other=0.1))
    assert bus.texts(SAID)[-1] == "moving"
    assert "body model" not in node.diagnostics.status().message


def test_silence_is_a_dead_man_too(robot: Any, send: Any, clock: Clock) -> None:
    send(0)
    robot.tick()
    assert robot.texts(SAID) == ["moving"]
    clock.now_s += 1.0
    robot.tick()
    assert robot.texts(SAID) == ["moving", "frozen: no posture for 0.5 s"]


def test_the_way_between_two_images_has_the_rate_of_the_robot(
    robot: Any, send: Any, clock: Clock
) -> None:
    for tenth in range(2):
        send(tenth)
    robot.sent["/retarget/joint_states"].clear()
    for _ in range(6):
        clock.now_s += 0.02
        robot.tick()
    sent = robot.sent["/retarget/joint_states"]
    assert [message.position[0] for message in sent] == pytest.approx(
        [-0.02, -0.04, -0.06, -0.08, -0.1, -0.1]
    )
    assert [message.velocity[0] for message in sent] == pytest.approx([-1.0] * 4 + [0.0] * 2)
    # The stamps go on from that of the image.
    seconds = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in sent]
    assert np.diff(seconds) == pytest.approx([0.02] * 5)


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
    for tenth in range(4):
        send(tenth)
    (point,) = robot.sent["/retarget/joint_trajectory"][-1].points
    reached_s = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
    assert reached_s <= 0.1 + 1e-9
    clock.now_s += 0.1
    robot.tick()
    stopped = positions(robot)[-1]
    assert stopped[0] == pytest.approx(-0.3)
    for _ in range(600):
        if is_repeated:
            send(3)  # the last image again and again
        else:
            clock.now_s += 0.1
        robot.tick()
    assert (positions(robot)[5:] == stopped).all()
    assert robot.texts(SAID) == ["moving", "frozen: no posture for 0.5 s"]
    send(700)  # the first image after silence moves nothing
    assert (positions(robot)[-1] == stopped).all()


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
        assert np.abs(positions(robot)[-1]).max() <= clock.now_s - began_s + 1e-9


def test_a_node_without_a_robot_does_not_start(bus: Any, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="robot_file"):
        bus.start(RetargetNode)
    with pytest.raises(CardboxError, match="No such file"):
        bus.start(RetargetNode, robot_file=str(tmp_path / "arm.urdf"))


def test_a_gripper_follows_the_hand_of_the_same_image(
    bus: Any, clock: Clock, joints: Any, tmp_path: Path
) -> None:
    joint_map = tmp_path / "map.yaml"
    joint_map.write_text("joints: [{from: right_hand_open, to: wrist_roll, scale: 0.2}]")
    bus.start(RetargetNode, robot_file=str(ARM), joint_map_file=str(joint_map))
    bus.send("/body_model", MODEL)
    for tenth, opened in enumerate((1.0, 1.0, 1.0, None)):
        clock.now_s += 0.1
        bus.send("/tracking_state", String(data="tracking"))
        bus.send("/joint_states", joints(tenth, {}))
        if opened is not None:
            header = joints(tenth, {}).header
            bus.send("/hands", JointState(header=header, name=["right_hand_open"], position=[1.0]))
        bus.send("/joint_states_stddev", joints(tenth, {}, other=0.1))
        bus.tick()
    goals = [one.points[0].positions[0] for one in bus.sent["/retarget/joint_trajectory"]]
    # The robot moves by its speed, and stays where it is without a hand.
    assert goals[0] == 0.0 and 0.0 < goals[1] < goals[2] <= 0.2
    assert goals[3] == pytest.approx(goals[2])
