"""What the tests of nodes that use a measured posture share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from cardbox_tracker.body.posture import JOINT_NAMES


class Heard:
    """Stands in for a publisher; keeps what it is given."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def publish(self, message: Any) -> None:
        self.messages.append(message)


@pytest.fixture
def heard() -> Callable[[], Heard]:
    return Heard


@pytest.fixture
def joints() -> Callable[..., Any]:
    """Make joint states of the tracker, with a stamp in tenths of a second."""
    from sensor_msgs.msg import JointState

    def make(tenth: int, values: dict[str, float], other: float = 0.0) -> Any:
        message = JointState(name=list(JOINT_NAMES))
        message.position = [values.get(name, other) for name in JOINT_NAMES]
        message.header.stamp.sec, message.header.stamp.nanosec = 1, tenth * 10**8
        return message

    return make


class Hands:
    """Stands for the nodes of one process: messages are handed over, not sent."""

    def __init__(self) -> None:
        self.takers: dict[str, Any] = {}

    def take(self, topic: str, taker: Any) -> bool:
        self.takers[topic] = taker
        return True

    def give(self, topic: str, message: Any) -> None:
        self.takers[topic](message, {"source_timestamp": 0})


@pytest.fixture
def hands() -> Hands:
    return Hands()
