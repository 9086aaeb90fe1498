"""No input can fill a log, because texts are limited by their kind."""

from __future__ import annotations

import pytest

from cardbox_tracker.ros.runtime.diagnostics import LogLimit


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_ever_different_texts_of_one_kind_are_soon_quiet() -> None:
    clock = Clock()
    limit = LogLimit(clock)
    logged = 0
    for number in range(60 * 60 * 24):
        clock.now_s += 1.0
        logged += limit.allows("encoding", f"encoding '{number}'")
    assert 100 < logged < 200, "a day of nonsense is not silent, and no flood either"
    assert all(len(spell.texts) <= 3 for spell in limit._spells.values()), "nor is it kept"


def test_a_flood_within_a_second_is_three_lines() -> None:
    limit = LogLimit(Clock())
    assert sum(limit.allows("encoding", str(number)) for number in range(10_000)) == 3


def test_kinds_do_not_hide_each_other_and_a_repeated_text_waits() -> None:
    clock = Clock()
    limit = LogLimit(clock)
    assert limit.allows("a", "text") and limit.allows("b", "text")
    assert not limit.allows("a", "text")
    clock.now_s += 10.0
    assert limit.allows("a", "text")


def test_what_comes_back_after_a_quiet_time_is_said_again() -> None:
    clock = Clock()
    limit = LogLimit(clock)
    limit.allows("a", "text")
    clock.now_s += 21.0
    assert limit.allows("a", "text")
    assert not limit.allows("a", "text")
