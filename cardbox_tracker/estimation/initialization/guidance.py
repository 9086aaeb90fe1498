"""Lead a person through the reference postures: say what to do, count down, capture, repeat.

Knows nothing of ROS, so that it can be tested without: it speaks, waits and captures through the
functions it is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cardbox_tracker.body.posture import REFERENCE_NAMES
from cardbox_tracker.errors import InitializationError

_TURN = {
    "left": "turn a quarter to your left",
    "right": "turn a quarter to your right",
}
_HOLD_S = 1.0
_READ_S = 2.0


def instruction(name: str, side_turn: str) -> str:
    """Return what a person has to do for the reference ``front``, ``side`` or ``arms``."""
    return {
        "front": "face the camera, arms hanging a little away from the body",
        "side": f"{_TURN[side_turn]}, arms hanging a little away from the body",
        "arms": "face the camera, both arms stretched sideways, just below the shoulders",
    }[name]


class Step(NamedTuple):
    """A line of the guidance: the reference (or ``measuring``), words, and the seconds left."""

    name: str
    words: str
    left_s: int | None


def step_of(status: str) -> Step | None:
    """Return the step that a line of ``initializer/status`` belongs to; None outside a guidance."""
    name, colon, words = status.partition(": ")
    if not colon or name not in (*REFERENCE_NAMES, "measuring"):
        return None
    said, _, count = words.rpartition(": ")
    return Step(name, said, int(count)) if count.isdigit() else Step(name, words, None)


class Guidance:
    """Guides through the postures that are missing."""

    def __init__(
        self,
        say: Callable[[str], None],
        capture: Callable[[str], str],
        wait: Callable[[float], None],
    ) -> None:
        """Keep the three functions.

        Args:
            say: shows a line to the person.
            capture: captures the reference of that name; raises InitializationError.
            wait: waits so many seconds; raises whatever ends the guidance.
        """
        self._say, self._capture, self._wait = say, capture, wait

    def run(self, missing: Sequence[str], side_turn: str, count_down_s: int, attempts: int) -> None:
        """Capture every reference in ``missing``.

        Raises:
            InitializationError: a posture could not be captured in ``attempts`` tries.
        """
        for name in missing:
            todo = instruction(name, side_turn)
            for attempt in range(1, attempts + 1):
                for left in range(count_down_s, 0, -1):
                    self._say(f"{name}: {todo}: {left}")
                    self._wait(1.0)
                self._say(f"{name}: hold still")
                self._wait(_HOLD_S)
                try:
                    self._say(f"{name}: {self._capture(name)}")
                    self._wait(_HOLD_S)
                    break
                except InitializationError as error:
                    self._say(f"{name}: not captured: {error}")
                    if attempt == attempts:
                        raise
                    self._wait(_READ_S)
