"""The guidance tells a person what to do, counts down, captures, and tries again."""

from __future__ import annotations

import pytest

from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.guidance import Guidance, instruction, step_of


class Room:
    """A person whose first ``failures`` captures fail."""

    def __init__(self, failures: int = 0) -> None:
        self.lines: list[str] = []
        self.captured: list[str] = []
        self.waited_s = 0.0
        self.failures = failures

    def capture(self, name: str) -> str:
        if self.failures:
            self.failures -= 1
            raise InitializationError("nobody is in the image")
        self.captured.append(name)
        return "captured"

    def wait(self, duration_s: float) -> None:
        self.waited_s += duration_s

    def guidance(self) -> Guidance:
        return Guidance(self.lines.append, self.capture, self.wait)


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


def test_every_line_of_the_guidance_is_a_step_and_no_other() -> None:
    lines: list[str] = []
    guidance = Guidance(lines.append, lambda name: f"captured '{name}'", lambda _: None)
    guidance.run(["front", "side", "arms"], "left", 3, 1)
    steps = [step_of(line) for line in lines]
    assert {step.name for step in steps if step} == {"front", "side", "arms"}
    assert [step.left_s for step in steps[:4] if step] == [3, 2, 1, None]
    assert steps[0] and steps[0].words == instruction("front", "left")
    assert step_of("measuring: 40 %") == ("measuring", "40 %", None)
    for other in ("", "measured; fit (IoU) front 0.93", "nobody is in the image: come nearer"):
        assert step_of(other) is None
