"""Limits of all nodes in one process."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.ros.nodes import single_process


class Node:
    """Replaces a node of any kind; the tracker has several cameras."""

    closed: list[str] = []  # noqa: RUF012

    def __init__(self, name: str) -> None:
        self.name = name
        cameras = ["cam0", "cam1"] if name == "tracker" else []
        self.parameters = SimpleNamespace(value=SimpleNamespace(cameras=cameras))

    def get_name(self) -> str:
        return self.name

    def close(self) -> None:
        self.closed.append(self.name)


def test_several_cameras_are_refused_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("background", "tracker", "initializer"):

        def make(of: str = name, **options: Any) -> Node:
            return Node(of)

        monkeypatch.setattr(single_process, f"{name.capitalize()}Node", make)
    with pytest.raises(CardboxError, match=r"tracker is \[cam0, cam1\].*two_cameras\.launch\.py"):
        single_process.AllNodes(None)
    assert Node.closed == ["tracker", "background"]
