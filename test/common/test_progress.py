"""A long wait is told with its seconds."""

from __future__ import annotations

import sys
import threading
from typing import Any

import pytest
from tqdm import tqdm

from cardbox_tracker.common import progress
from cardbox_tracker.common.progress import progress_bar, told


def test_a_wait_is_told_at_once_and_again_until_it_ends() -> None:
    said: list[str] = []
    third = threading.Event()

    def say(text: str) -> None:
        said.append(text)
        if len(said) == 3:
            third.set()

    with told(say, "compiling", every_s=0.01):
        assert said[0] == "compiling"
        assert third.wait(30.0)
    count = len(said)
    assert all(text == "compiling: 0 s so far" for text in said[1:3])
    assert not any(thread.name == "told" for thread in threading.enumerate())
    assert len(said) == count


def test_an_error_ends_the_telling() -> None:
    with pytest.raises(RuntimeError, match="stop"), told(lambda _: None, "compiling", 0.01):
        raise RuntimeError("stop")
    assert not any(thread.name == "told" for thread in threading.enumerate())


def test_the_seconds_of_a_bar_go_on_while_nothing_is_finished(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = threading.Semaphore(0)
    refresh = tqdm.refresh

    def seen(bar: tqdm, *given: Any, **named: Any) -> None:
        refresh(bar, *given, **named)
        drawn.release()

    monkeypatch.setattr(tqdm, "refresh", seen)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(progress, "told", lambda say, text, _: told(say, text, 0.01))
    with progress_bar("track"):
        assert all(drawn.acquire(timeout=30.0) for _ in range(3))
    assert "track:   0%" in capfd.readouterr().err


def test_a_file_gets_a_line_for_each_tenth(capfd: pytest.CaptureFixture[str]) -> None:
    with progress_bar("track") as show:
        for number in range(1001):
            show(number / 1000)
    assert capfd.readouterr().err.splitlines() == [f"track: {10 * n}%" for n in range(11)]
