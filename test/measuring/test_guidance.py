"""The guidance tells a person what to do, counts down, captures, and tries again."""

from __future__ import annotations

import pytest

from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.guidance import (
    BAD,
    GOOD,
    HOLD_STILL,
    Prompt,
    guide,
    instruction,
    measuring,
    short_words,
    spoken,
)


class Room:
    """A person whose first ``failures`` captures fail."""

    def __init__(self, failures: int = 0) -> None:
        self.steps: list[Prompt] = []
        self.captured: list[str] = []
        self.waited_s = 0.0
        self.failures = failures

    @property
    def lines(self) -> list[str]:
        return [step.text for step in self.steps]

    def capture(self, name: str) -> str:
        if self.failures:
            self.failures -= 1
            raise InitializationError("nobody is in the image", "Step into the picture")
        self.captured.append(name)
        return "captured"

    def wait(self, duration_s: float) -> None:
        self.waited_s += duration_s

    def guide(self, missing: list[str], turn: str, count_down_s: int, attempts: int = 2) -> None:
        ways = self.steps.append, self.capture, self.wait
        guide(missing, turn, count_down_s, attempts, *ways)


def test_only_missing_postures_are_guided_with_a_line_a_second() -> None:
    room = Room()
    room.guide(["side", "arms"], "right", 3)
    assert room.captured == ["side", "arms"]
    assert [line.rsplit(": ", 1)[1] for line in room.lines[:3]] == ["3", "2", "1"]
    assert "turn a quarter to your right" in room.lines[0]
    assert len(room.lines) >= room.waited_s


def test_a_failed_capture_says_why_and_is_tried_again() -> None:
    room = Room(failures=1)
    room.guide(["front"], "left", 1)
    assert room.captured == ["front"]
    assert "front: not captured: nobody is in the image" in room.lines
    assert ("Step into the picture", BAD) in [(step.words, step.mood) for step in room.steps]


def test_it_gives_up_with_the_reason() -> None:
    room = Room(failures=9)
    with pytest.raises(InitializationError, match="nobody"):
        room.guide(["front"], "left", 1)
    assert room.captured == []


@pytest.mark.parametrize("name", ["front", "side", "arms"])
def test_each_posture_has_an_instruction(name: str) -> None:
    assert instruction(name, "left")


def test_steps_have_their_posture_words_and_count() -> None:
    room = Room()
    room.guide(["front", "side", "arms"], "left", 3, 1)
    assert {step.name for step in room.steps} == {"front", "side", "arms"}
    words = short_words("front", "left")
    assert room.steps[:5] == [
        *(Prompt("front", words, left, instruction("front", "left")) for left in (3, 2, 1)),
        Prompt("front", HOLD_STILL, detail="hold still"),
        Prompt("front", "Good.", detail="captured", mood=GOOD),
    ]


def test_steps_as_lines() -> None:
    assert Prompt("side", "turn", 2).text == "side: turn: 2"
    assert Prompt("side", "hold still").text == "side: hold still"
    assert Prompt("side", "Good.", detail="captured 'side' from 5").text == (
        "side: captured 'side' from 5"
    )
    assert measuring(0.404).text == "measuring: 40 %"


def test_what_is_said_is_short_and_said_once() -> None:
    """Every sentence when it begins, and the last three seconds, for who looks aside."""
    room = Room()
    room.guide(["front", "side"], "left", 5, 1)
    steps = [*room.steps, measuring(0.1), measuring(0.2)]
    heard = [spoken(before, step) for before, step in zip([None, *steps], steps, strict=False)]
    assert [words for words in heard if words] == [
        *("Face the camera, arms a little out", "3", "2", "1", "Hold still", "Good."),
        *("Now turn left, arms as before", "3", "2", "1", "Hold still", "Good."),
        "Good. Measuring, you may relax",
    ]
