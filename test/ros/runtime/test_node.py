"""What all nodes share while they run."""

from __future__ import annotations

import gc

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from cardbox_tracker.ros.runtime.node import run


class Nothing:
    """Holds nothing."""

    def close(self) -> None:
        """Release nothing."""


def test_a_running_node_is_not_searched_for_garbage() -> None:
    frozen = []
    gc.unfreeze()
    try:
        assert run(Nothing, [], lambda _: frozen.append(gc.get_freeze_count())) == 0
    finally:
        gc.unfreeze()
    assert frozen[0] > 1000
