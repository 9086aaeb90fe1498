"""A long wait is told with its seconds."""

from __future__ import annotations

import threading

import pytest

from cardbox_tracker.progress import told


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
