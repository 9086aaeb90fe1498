"""Lead a person through the reference postures: say what to do, count down, capture, repeat.

Knows nothing of ROS, so that it can be tested without: it speaks, waits and captures through the
functions it is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

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
        "arms": "face the camera, arms stretched sideways, just below the shoulders, hands open",
    }[name]


class Step(NamedTuple):
    """A moment of the guidance.

    Attributes:
        name: the reference, or ``measuring``.
        words: what to do, or what happened.
        left_s: seconds of the count-down that are left; None while nothing is counted.
    """

    name: str
    words: str
    left_s: int | None = None

    @property
    def text(self) -> str:
        """The step as a line for a person."""
        count = "" if self.left_s is None else f": {self.left_s}"
        return f"{self.name}: {self.words}{count}"


def measuring(fraction: float) -> Step:
    """Return the step of the measurement after the last capture, done to ``fraction``."""
    return Step("measuring", f"{100 * fraction:.0f} %")


class Guidance:
    """Guides through the postures that are missing."""

    def __init__(
        self,
        show: Callable[[Step], None],
        capture: Callable[[str], str],
        wait: Callable[[float], None],
    ) -> None:
        """Keep the three functions.

        Args:
            show: shows a step to the person.
            capture: captures the reference of that name; raises InitializationError.
            wait: waits that many seconds; raises whatever ends the guidance.
        """
        self._show, self._capture, self._wait = show, capture, wait

    def run(self, missing: Sequence[str], side_turn: str, count_down_s: int, attempts: int) -> None:
        """Capture every reference in ``missing``.

        Raises:
            InitializationError: a posture could not be captured in ``attempts`` tries.
        """
        for name in missing:
            todo = instruction(name, side_turn)
            for attempt in range(1, attempts + 1):
                for left in range(count_down_s, 0, -1):
                    self._show(Step(name, todo, left))
                    self._wait(1.0)
                self._show(Step(name, "hold still"))
                self._wait(_HOLD_S)
                try:
                    self._show(Step(name, self._capture(name)))
                    self._wait(_HOLD_S)
                    break
                except InitializationError as error:
                    self._show(Step(name, f"not captured: {error}"))
                    if attempt == attempts:
                        raise
                    self._wait(_READ_S)
