"""Shared argument types: what they read, and that each mistake is told in one form."""

from __future__ import annotations

import argparse

import pytest

from cardbox_tracker.commands.arguments import at_least, span, time


def test_what_is_right_is_read() -> None:
    assert span("0:3.9") == (0.0, 3.9)
    assert time("15.6") == 15.6
    assert [at_least(0)("0"), at_least(2)("2"), at_least(2)("17")] == [0, 2, 17]


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
@pytest.mark.parametrize("lowest", [0, 1, 2])
def test_numbers_that_are_none(lowest: int, text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        at_least(lowest)(text)
    assert f"{lowest} or more" in str(caught.value) and repr(text) in str(caught.value)


@pytest.mark.parametrize("lowest", [1, 2])
def test_numbers_that_are_too_low(lowest: int) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"{lowest} or more"):
        at_least(lowest)(str(lowest - 1))
