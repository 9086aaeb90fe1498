"""The teleoperator for LeRobot returns the newest joints at once, and holds without new ones.

Where LeRobot is not installed, its two base classes are stand-ins.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

zmq = pytest.importorskip("zmq", reason="pyzmq is not installed")

from cardbox_tracker.applications.teleoperation.sending import (  # noqa: E402
    ZmqSender,
    joints_packet,
)

SOURCE = Path(__file__).parents[3] / "lerobot_teleoperator_cardbox/lerobot_teleoperator_cardbox.py"
ADDRESS = "tcp://127.0.0.1:51874"
NAMES = ("lift", "jaw", "other")
LOWER, UPPER = np.array([-2.0, 0.0, -1.0]), np.array([1.0, 2.0, 1.0])


@dataclass(kw_only=True)
class StandInConfig:
    id: str | None = None
    calibration_dir: Path | None = None

    @classmethod
    def register_subclass(cls, _: str) -> Callable[[type], type]:
        return lambda kind: kind


class StandInTeleoperator:
    def __init__(self, config: StandInConfig) -> None:
        self.id = config.id


@pytest.fixture(scope="module")
def plugin() -> Iterator[ModuleType]:
    replaced = {}
    if find_spec("lerobot") is None:
        below = "lerobot.teleoperators"
        replaced = {
            f"{below}.config": SimpleNamespace(TeleoperatorConfig=StandInConfig),
            f"{below}.teleoperator": SimpleNamespace(Teleoperator=StandInTeleoperator),
            **dict.fromkeys(("lerobot", below), ModuleType("lerobot")),
        }
    patch = pytest.MonkeyPatch()
    for name, module in replaced.items():
        patch.setitem(sys.modules, name, module)
    spec = spec_from_file_location("lerobot_teleoperator_cardbox", SOURCE)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    patch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    yield module
    patch.undo()


@pytest.fixture
def make(plugin: ModuleType, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    made = []

    def create(**values: Any) -> Any:
        given = {"joints": ["lift", "jaw"], "percent": ["jaw"], "wait_s": 5.0, **values}
        config = plugin.CardboxTeleoperatorConfig(
            id="one", calibration_dir=tmp_path, address=ADDRESS, **given
        )
        made.append(plugin.CardboxTeleoperator(config))
        return made[-1]

    yield create
    for one in made:
        one.disconnect()


@pytest.fixture
def sender() -> Iterator[ZmqSender]:
    with closing(ZmqSender(ADDRESS)) as made:
        yield made


def commanded(sender: ZmqSender, lift: float, jaw: float) -> None:
    sender.send(joints_packet(1, NAMES, np.array([lift, jaw, 0.0]), LOWER, UPPER))


def connected(teleoperator: Any, sender: ZmqSender) -> Any:
    """Connect while commands come."""
    is_done = threading.Event()

    def repeat() -> None:
        while not is_done.wait(0.02):
            commanded(sender, 0.5, 0.5)

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        teleoperator.connect()
    finally:
        is_done.set()
        thread.join()
    return teleoperator


def newest(teleoperator: Any, expected: dict[str, float]) -> None:
    until_s = time.monotonic() + 2.0
    while time.monotonic() < until_s:
        if teleoperator.get_action() == pytest.approx(expected, abs=1e-3):
            return
        time.sleep(0.01)
    assert teleoperator.get_action() == pytest.approx(expected, abs=1e-3)


def test_the_newest_command_is_returned_without_waiting(
    make: Any, sender: ZmqSender, caplog: pytest.LogCaptureFixture
) -> None:
    teleoperator = connected(make(stale_s=0.1), sender)
    assert teleoperator.is_connected
    assert teleoperator.get_action().keys() == teleoperator.action_features.keys()
    for _ in range(5):
        commanded(sender, 0.0, 0.0)
    commanded(sender, np.pi / 6, 0.5)
    newest(teleoperator, {"lift.pos": 30.0, "jaw.pos": 25.0})
    begun_s = time.monotonic()
    for _ in range(100):
        teleoperator.get_action()
    assert time.monotonic() - begun_s < 0.5
    time.sleep(0.12)
    assert teleoperator.get_action() == pytest.approx({"lift.pos": 30.0, "jaw.pos": 25.0}, abs=1e-3)
    assert caplog.text.count("no new command for 0.1 s; the robot holds") == 1
    teleoperator.disconnect()
    with pytest.raises(ConnectionError, match="not connected"):
        teleoperator.get_action()


def test_shares_of_the_range_are_those_of_the_limits(make: Any, sender: ZmqSender) -> None:
    teleoperator = connected(make(use_degrees=False), sender)
    commanded(sender, -2.0, 2.0)
    newest(teleoperator, {"lift.pos": -100.0, "jaw.pos": 100.0})


def within(value: str) -> bytes:
    """Return a command whose first joint is at a value."""
    lift = f'"positions":[{value},1]'
    return f'{{"names":["lift","jaw"],{lift},"lower":[-2,0],"upper":[1,2]}}'.encode()


@pytest.mark.parametrize(
    "packet",
    [
        *(b"", b"pose1", b"\xff\xfe", b"[1]", b"{}", b"[" * 100_000, b"7"),
        b'{"names":["lift"],"positions":[0],"lower":[-2],"upper":[1]}',
        b'{"names":[[]],"positions":[0],"lower":[-2],"upper":[1]}',
        *map(within, ("NaN", "Infinity", "-Infinity", "1e9", "1.1", '"1"', "9" * 400)),
    ],
    ids=range(16),
)
def test_what_is_no_command_within_the_limits_is_refused(
    make: Any, sender: ZmqSender, caplog: pytest.LogCaptureFixture, packet: bytes
) -> None:
    teleoperator = connected(make(), sender)
    sender.send(within("0"))
    newest(teleoperator, {"lift.pos": 0.0, "jaw.pos": 50.0})
    sender.send(packet)
    until_s = time.monotonic() + 2.0
    while "is refused" not in caplog.text and time.monotonic() < until_s:
        assert teleoperator.get_action() == {"lift.pos": 0.0, "jaw.pos": 50.0}
        time.sleep(0.01)
    assert caplog.text.count("is refused") == 1
    assert teleoperator.get_action() == {"lift.pos": 0.0, "jaw.pos": 50.0}
    sender.send(within("1.000001"))
    newest(teleoperator, {"lift.pos": np.degrees(1.0), "jaw.pos": 50.0})


def test_mistakes_are_told(make: Any, sender: ZmqSender) -> None:
    with pytest.raises(ConnectionError, match="no command came on tcp:"):
        make(wait_s=0.05).connect()
    with pytest.raises(ValueError, match="no joint arm, only lift, jaw, other"):
        connected(make(joints=["arm"]), sender)
