"""Shared argument types: what they read, and that each mistake is told in one form."""

from __future__ import annotations

import argparse
from collections.abc import Callable

import pytest

from cardbox_tracker.commands.arguments import (
    particle_count,
    process_count,
    run_count,
    seed,
    seed_count,
    span,
    time,
)


def test_what_is_right_is_read() -> None:
    assert span("0:3.9") == (0.0, 3.9)
    assert time("15.6") == 15.6
    assert [seed("0"), particle_count("2"), run_count("2")] == [0, 2, 2]
    assert [process_count("1"), seed_count("1")] == [1, 1]


@pytest.mark.parametrize("text", ["5", "9:3", "3:3", "a:b", "1:", "-2:3", "nan:4", ""])
def test_spans_that_are_none(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        span(text)
    assert str(caught.value) == (
        f"expected T0:T1, seconds from the start of the recording with T0 before T1, got {text!r}"
    )


@pytest.mark.parametrize("text", ["-1", "soon", "inf", "nan", ""])
def test_times_that_are_none(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        time(text)
    assert "seconds" in str(caught.value) and repr(text) in str(caught.value)


@pytest.mark.parametrize("text", ["-1", "2.5", "many", ""])
@pytest.mark.parametrize(
    ("kind", "lowest"),
    [(seed, 0), (particle_count, 2), (run_count, 2), (process_count, 1), (seed_count, 1)],
)
def test_numbers_that_are_none(kind: Callable[[str], int], lowest: int, text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        kind(text)
    assert f"{lowest} or more" in str(caught.value) and repr(text) in str(caught.value)


@pytest.mark.parametrize(("kind", "lowest"), [(particle_count, 2), (run_count, 2)])
def test_numbers_that_are_too_low(kind: Callable[[str], int], lowest: int) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"{lowest} or more"):
        kind(str(lowest - 1))
