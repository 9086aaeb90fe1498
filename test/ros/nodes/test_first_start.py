"""The first start compiles for a while: it says so, and what is called meanwhile is not lost."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.parameter import Parameter

from cardbox_tracker.ros.nodes import background_node, tracker_node


class Telling:
    """Stands for ``told``; ``text`` is what is told at the moment."""

    text = ""

    @contextmanager
    def __call__(self, _: Any, text: str) -> Iterator[None]:
        self.text = text
        yield
        self.text = ""


def test_the_tracker_tells_that_it_compiles_and_takes_calls_of_reset(
    bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    telling, offered, seen = Telling(), [], []

    def offer(_: Any, name: str, action: Callable[[], str]) -> None:
        offered.append(name)

    monkeypatch.setattr(tracker_node, "told", telling)
    monkeypatch.setattr(tracker_node.TrackerNode, "offer", offer)

    def compile_all(presets: list[str], **needed: bool) -> None:
        seen.append((telling.text, list(offered), presets, needed))

    monkeypatch.setattr(tracker_node, "compile_all", compile_all)
    bus.start(tracker_node.TrackerNode)
    ((text, services, presets, needed),) = seen
    assert presets == ["default"]
    assert needed == {"several_cameras": False, "points": False}
    assert "compiles" in text
    assert services == ["~/reset"]


def test_the_code_of_another_preset_is_prepared_when_it_is_chosen(
    bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(tracker_node, "compile_all", lambda presets, **_: seen.extend(presets))
    node = bus.start(tracker_node.TrackerNode)
    for preset in ("paper", "default", "paper"):
        node.set_parameters([Parameter("preset", value=preset)])
    node.set_parameters([Parameter("effort", value=0.5)])
    assert seen == ["default", "paper"]


def test_the_background_node_tells_that_it_compiles_and_announces_silhouettes(
    bus: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    telling, seen = Telling(), []
    monkeypatch.setattr(background_node, "told", telling)
    monkeypatch.setattr(
        background_node, "warm_up", lambda: seen.append((telling.text, set(bus.sent)))
    )
    bus.start(background_node.BackgroundNode)
    ((text, topics),) = seen
    assert "compiles" in text
    assert "/silhouette" in topics
