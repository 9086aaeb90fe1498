"""The topics that libhri reads: a body's URDF, and the list of bodies from hri_msgs."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy
from std_msgs.msg import Header

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.ros.nodes.tracker_outputs import Rep155Outputs, TrackedBodies
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate

PLACE = "/humans/bodies/p1"


class IdsList(SimpleNamespace):
    """Replaces the message of hri_msgs."""


class Recorder:
    """A node that records published messages."""

    def __init__(self) -> None:
        self.sent: dict[str, list[Any]] = {}
        self.latched: set[str] = set()

    def advertise(self, kind: Any, topic: str, profile: Any) -> Any:
        self.sent[topic] = []
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            self.latched.add(topic)
        return SimpleNamespace(publish=self.sent[topic].append)


def published(*estimates: Estimate) -> Recorder:
    node: Any = Recorder()
    settings: Any = SimpleNamespace(torso_place=True)
    outputs = Rep155Outputs(node, settings, "p1", TrackedBodies(node))
    tracker: Any = SimpleNamespace(body=BodyModel.of(distance_m=2.3))
    for estimate in estimates:
        outputs.publish(Header(frame_id="eye"), estimate, tracker)
    return node


FOUND = Estimate(TRACKING, reference_posture("front"), np.full(12, 0.1))


def test_the_urdf_is_where_libhri_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "hri_msgs.msg", None)
    node = published(FOUND, FOUND)
    assert {f"{PLACE}/urdf", f"{PLACE}/robot_description"} == node.latched
    (text,), (same,) = node.sent[f"{PLACE}/urdf"], node.sent[f"{PLACE}/robot_description"]
    assert text.data == same.data and "human_p1" in text.data
    assert "/humans/bodies/tracked" not in node.sent


def test_the_head_looks_up_where_the_neck_bends_back() -> None:
    looking = replace(FOUND, neck=np.array([0.4, -0.2]), neck_stddev=np.array([0.1, 0.1]))
    straight, turned = published(FOUND, looking).sent[f"{PLACE}/joint_states"]
    for message, angles in ((straight, [0.0, 0.0]), (turned, [0.4, 0.2])):
        values = dict(zip(message.name, message.position, strict=True))
        assert [values["y_head_p1"], values["p_head_p1"]] == angles


def test_with_hri_msgs_it_is_said_who_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("hri_msgs.msg")
    module.__dict__["IdsList"] = IdsList
    monkeypatch.setitem(sys.modules, "hri_msgs", ModuleType("hri_msgs"))
    monkeypatch.setitem(sys.modules, "hri_msgs.msg", module)
    node = published(FOUND, Estimate(LOST), FOUND)
    lists = node.sent["/humans/bodies/tracked"]
    assert [message.ids for message in lists] == [["p1"], [], ["p1"]]
    assert lists[0].header.frame_id == "eye"


def test_several_people_are_in_one_list(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("hri_msgs.msg")
    module.__dict__["IdsList"] = IdsList
    monkeypatch.setitem(sys.modules, "hri_msgs", ModuleType("hri_msgs"))
    monkeypatch.setitem(sys.modules, "hri_msgs.msg", module)
    node: Any = Recorder()
    settings: Any = SimpleNamespace(torso_place=True)
    bodies = TrackedBodies(node, 2)
    people = [Rep155Outputs(node, settings, name, bodies) for name in ("p_1", "p_2")]
    tracker: Any = SimpleNamespace(body=BodyModel.of(distance_m=2.3))
    for found in ((FOUND, FOUND), (Estimate(LOST), FOUND)):
        for outputs, estimate in zip(people, found, strict=True):
            outputs.publish(Header(frame_id="eye"), estimate, tracker)
    lists = node.sent["/humans/bodies/tracked"]
    assert [message.ids for message in lists] == [["p_1", "p_2"], ["p_2"]]
    assert len(node.sent["/humans/bodies/p_2/joint_states"]) == 2
