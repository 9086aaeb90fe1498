"""The node ``rula`` scores postures, and publishes nothing without their deviations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.ros.nodes.rula_node import RulaNode

MODEL = String(data=dumps_body_model(body_from_proportions(1.75, 2.0, 0.4, 0.0)))


@pytest.fixture(autouse=True)
def node(bus: Any) -> None:
    bus.start(RulaNode)


def send(bus: Any, joints: JointState, stddev: JointState) -> None:
    bus.send("/joint_states", joints)
    bus.send("/joint_states_stddev", stddev)


def test_a_pair_is_scored_under_its_stamp(bus: Any, joints: Any) -> None:
    bus.send("/body_model", MODEL)
    bent = {"left_shoulder_abduction": 1.75, "torso_pitch": 0.6}
    send(bus, joints(7, bent), joints(7, {}, other=0.001))
    (report,) = bus.sent["/rula/report"]
    assert report.header.stamp.nanosec == 7 * 10**8
    values = {value.key: value.value for value in report.status[0].values}
    assert values["likeliest score"] == values["score of the mean posture"] == "5"
    assert float(values["score with the right arm"]) < float(values["score with the left arm"])
    # Upper arms 5 and 1, table A 6 and 2; trunk 3, table B 3.
    assert (values["upper arm, left"], values["upper arm, right"]) == ("5.00", "1.00")
    assert (values["table A, left"], values["table B"]) == ("6.00", "3.00")
    assert values["neck (declared)"] == "1.00"
    assert values["declared, not seen"].startswith("neck 1 (default), wrist 1 (default)")
    (score,), (chances,) = bus.texts("/rula/score"), map(np.array, bus.texts("/rula/chances"))
    assert score == pytest.approx(float(values["score"]), abs=0.01)
    assert chances.argmax() + 1 == 5
    assert chances.sum() == pytest.approx(1)


def test_a_neck_counts_where_its_deviations_are_known(bus: Any, joints: Any) -> None:
    bus.send("/body_model", MODEL)
    for number, has_deviations in ((5, False), (6, True)):
        states, deviations = joints(number, {}), joints(number, {}, other=0.001)
        for message, values in ((states, (0.0, 0.5)), (deviations, (0.001, 0.001))):
            if message is states or has_deviations:
                message.name = [*message.name, "neck_yaw", "neck_pitch"]
                message.position = [*message.position, *values]
        send(bus, states, deviations)
    assert bus.texts("/rula/score") == [pytest.approx(2.0), pytest.approx(3.0)]


def test_a_wrist_counts_where_its_deviations_are_known(bus: Any, joints: Any) -> None:
    bus.send("/body_model", MODEL)
    names = ["left_wrist_flexion", "left_wrist_deviation"]
    for number, has_deviations in ((5, False), (6, True)):
        states, deviations = joints(number, {}), joints(number, {}, other=0.001)
        for message, values in ((states, (0.5, 0.0)), (deviations, (0.001, 0.001))):
            if message is states or has_deviations:
                message.name, message.position = (
                    [*message.name, *names],
                    [*message.position, *values],
                )
        send(bus, states, deviations)
    found = [{v.key: v.value for v in one.status[0].values} for one in bus.sent["/rula/report"]]
    assert found[0]["wrist, left (declared)"] == found[1]["wrist, right (declared)"] == "1.00"
    assert found[1]["wrist, left (measured)"] == "3.00"


def test_deviations_of_another_image_are_not_taken(bus: Any, joints: Any) -> None:
    bus.send("/body_model", MODEL)
    send(bus, joints(7, {}), joints(8, {}))
    assert not bus.sent["/rula/score"]


def test_without_a_body_nothing_is_said(bus: Any, joints: Any) -> None:
    send(bus, joints(7, {}), joints(7, {}))
    assert not bus.sent["/rula/score"]


def test_what_is_no_posture_is_refused(bus: Any, joints: Any) -> None:
    bus.send("/body_model", MODEL)
    for posture, stddev, word in (
        (JointState(name=["elbow"], position=[0.0]), JointState(), "torso_y"),
        (joints(9, {"torso_pitch": float("nan")}), joints(9, {}), "finite"),
    ):
        send(bus, posture, stddev)
        status = bus.tick()
        assert status.level == DiagnosticStatus.ERROR
        assert word in status.message
    assert not bus.sent["/rula/score"]
