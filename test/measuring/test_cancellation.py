"""An initialization can be ended at any time, and the next one is not."""

from __future__ import annotations

import threading

import pytest

from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.guidance import CANCELLED, FAILED, FINISHED, Cancellation


def test_without_an_initialization_there_is_nothing_to_cancel() -> None:
    running = Cancellation()
    with pytest.raises(InitializationError, match="no initialization"):
        running.cancel()
    assert running.begin() and not running.begin()
    assert running.end(success=True) == FINISHED
    with pytest.raises(InitializationError, match="no initialization"):
        running.cancel()


def test_cancelling_ends_a_wait_and_not_those_of_the_next_one() -> None:
    running = Cancellation()
    running.begin()
    waiting = threading.Timer(0.05, running.cancel)
    waiting.start()
    with pytest.raises(InitializationError, match="cancelled"):
        running.wait(60.0)
    assert running.end(success=False) == CANCELLED
    assert running.begin()
    running.wait(0.0)
    assert running.end(success=False) == FAILED


def test_after_the_node_has_stopped_nothing_waits() -> None:
    running = Cancellation()
    running.stop()
    assert running.begin()
    with pytest.raises(InitializationError, match="stopped"):
        running.wait(60.0)
