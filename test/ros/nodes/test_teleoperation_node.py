"""The node ``teleoperation`` streams what the tracker says, and that nothing is known."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from std_msgs.msg import String

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.ros.nodes.teleoperation_node import TeleoperationNode

MODEL = String(data=dumps_body_model(body_from_proportions(1.75, 2.0, 0.4, 0.0)))
RIGHT_HAND = 23


@pytest.fixture
def send(bus: Any, joints: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that sends an image's messages, and lets time pass before the timer."""
    now_s = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])

    def hand_over(tenth: int | None, after_s: float, **angles: float) -> None:
        if tenth is not None:
            bus.send("/tracking_state", String(data="tracking"))
            bus.send("/joint_states", joints(tenth, angles))
            bus.send("/joint_states_stddev", joints(tenth, {}, other=0.1))
        now_s[0] += after_s
        bus.tick()

    return hand_over


def test_the_hand_moves_between_images_and_silence_is_invalid(bus: Any, send: Any) -> None:
    bus.start(TeleoperationNode, to="json")
    bus.send("/body_model", MODEL)
    bus.tick()
    send(1, 0.0)
    send(2, 0.05, right_shoulder_flexion=1.0)
    send(None, 0.05)
    send(None, 0.5)
    found = [json.loads(text) for text in bus.texts("/teleoperation/full_body")]
    assert [any(one["valid"]) for one in found] == [True, True, True, False]
    hand = np.array([one["positions"][RIGHT_HAND] for one in found])
    assert hand[1] == pytest.approx((hand[0] + hand[2]) / 2, abs=1e-4)
    assert hand[2][0] > 0.3 and (hand[3] == hand[2]).all()
    assert found[1]["stamp_ns"] - found[0]["stamp_ns"] == 50_000_000


def test_isaac_gets_nothing_of_a_person_who_left(bus: Any, send: Any) -> None:
    bus.start(TeleoperationNode)
    bus.send("/body_model", MODEL)
    send(1, 0.0)
    packed = bus.sent["/xr_teleop/full_body"]
    assert len(packed) == 1 and b"".join(packed[0].data).startswith(b"\x85\xa9timestamp")
    bus.send("/tracking_state", String(data="lost"))
    bus.tick()
    assert len(packed) == 1


def test_sonic_needs_an_address(bus: Any) -> None:
    with pytest.raises(CardboxError, match="sonic has no topic: give the parameter address"):
        bus.start(TeleoperationNode, to="sonic")
