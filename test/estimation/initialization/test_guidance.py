"""The guidance tells a person what to do, counts down, captures, and tries again."""

from __future__ import annotations

import pytest

from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.guidance import (
    Guidance,
    Step,
    instruction,
    measuring,
)


class Room:
    """A person whose first ``failures`` captures fail."""

    def __init__(self, failures: int = 0) -> None:
        self.steps: list[Step] = []
        self.captured: list[str] = []
        self.waited_s = 0.0
        self.failures = failures

    @property
    def lines(self) -> list[str]:
        return [step.text for step in self.steps]

    def capture(self, name: str) -> str:
        if self.failures:
            self.failures -= 1
            raise InitializationError("nobody is in the image")
        self.captured.append(name)
        return "captured"

    def wait(self, duration_s: float) -> None:
        self.waited_s += duration_s

    def guidance(self) -> Guidance:
        return Guidance(self.steps.append, self.capture, self.wait)


def test_only_missing_postures_are_guided_with_a_line_a_second() -> None:
    room = Room()
    room.guidance().run(["side", "arms"], "right", count_down_s=3, attempts=2)
    assert room.captured == ["side", "arms"]
    assert [line.rsplit(": ", 1)[1] for line in room.lines[:3]] == ["3", "2", "1"]
    assert "turn a quarter to your right" in room.lines[0]
    assert len(room.lines) >= room.waited_s


def test_a_failed_capture_says_why_and_is_tried_again() -> None:
    room = Room(failures=1)
    room.guidance().run(["front"], "left", count_down_s=1, attempts=2)
    assert room.captured == ["front"]
    assert "front: not captured: nobody is in the image" in room.lines


def test_it_gives_up_with_the_reason() -> None:
    room = Room(failures=9)
    with pytest.raises(InitializationError, match="nobody is in the image"):
        room.guidance().run(["front"], "left", count_down_s=1, attempts=2)
    assert room.captured == []


@pytest.mark.parametrize("name", ["front", "side", "arms"])
def test_each_posture_has_an_instruction(name: str) -> None:
    assert instruction(name, "left")


def test_steps_have_their_posture_words_and_count() -> None:
    room = Room()
    room.guidance().run(["front", "side", "arms"], "left", 3, 1)
    assert {step.name for step in room.steps} == {"front", "side", "arms"}
    assert room.steps[:5] == [
        *(Step("front", instruction("front", "left"), left) for left in (3, 2, 1)),
        Step("front", "hold still"),
        Step("front", "captured"),
    ]


def test_steps_as_lines() -> None:
    assert Step("side", "turn", 2).text == "side: turn: 2"
    assert Step("side", "hold still").text == "side: hold still"
    assert measuring(0.404).text == "measuring: 40 %"
