"""Lead a person through the reference postures: say what to do, count down, capture, repeat.

Knows nothing of ROS, so that it can be tested without: it speaks, waits and captures through the
functions it is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cardbox_tracker.errors import InitializationError

ASK, GOOD, BAD = "ask", "good", "bad"
"""Whether a step asks for something, or says that it went well or did not."""

HOLD_STILL = "Hold still"
FINISHED, FAILED, CANCELLED = "Thank you. Done.", "That did not work. Sorry.", "Stopped."

_TURN = {
    "left": "turn a quarter to your left",
    "right": "turn a quarter to your right",
}
_HOLD_S = 1.0
_READ_S = 2.0
# From here on the count is said aloud: who stands sideways does not see it.
_SAID_COUNT = 3


def instruction(name: str, side_turn: str) -> str:
    """Return what a person has to do for the reference ``front``, ``side`` or ``arms``."""
    return {
        "front": "face the camera, arms hanging a little away from the body",
        "side": f"{_TURN[side_turn]}, arms hanging a little away from the body",
        "arms": "face the camera, arms stretched sideways, just below the shoulders, hands open",
    }[name]


def short_words(name: str, side_turn: str) -> str:
    """Return the same in words that are read at two metres and heard in passing."""
    return {
        "front": "Face the camera, arms a little out",
        "side": f"Now turn {side_turn}, arms as before",
        "arms": "Face the camera, arms out sideways",
    }[name]


class Step(NamedTuple):
    """A moment of the guidance.

    Attributes:
        name: the reference, or ``measuring``.
        words: what to do, or what happened, for the person: a few words.
        left_s: seconds of the count-down that are left; None while nothing is counted.
        detail: the same for whoever runs the program; the words if there is no more to say.
        mood: ``ask``, ``good`` or ``bad``.
    """

    name: str
    words: str
    left_s: int | None = None
    detail: str = ""
    mood: str = ASK

    @property
    def text(self) -> str:
        """The step as a line for whoever runs the program."""
        count = "" if self.left_s is None else f": {self.left_s}"
        return f"{self.name}: {self.detail or self.words}{count}"


def said(before: Step | None, step: Step) -> str:
    """Return what is said aloud of ``step`` after the step ``before``; may be empty."""
    if before is None or before.words != step.words or before.name != step.name:
        return step.words
    if step.left_s is not None and step.left_s != before.left_s and step.left_s <= _SAID_COUNT:
        return str(step.left_s)
    return ""


def measuring(fraction: float) -> Step:
    """Return the step of the measurement after the last capture, done to ``fraction``."""
    return Step("measuring", "Good. Measuring, you may relax", detail=f"{100 * fraction:.0f} %")


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
            words, detail = short_words(name, side_turn), instruction(name, side_turn)
            for attempt in range(1, attempts + 1):
                for left in range(count_down_s, 0, -1):
                    self._show(Step(name, words, left, detail))
                    self._wait(1.0)
                self._show(Step(name, HOLD_STILL, detail="hold still"))
                self._wait(_HOLD_S)
                try:
                    done = self._capture(name)
                    self._show(Step(name, "Good.", detail=done, mood=GOOD))
                    self._wait(_HOLD_S)
                    break
                except InitializationError as error:
                    failed = f"not captured: {error}"
                    self._show(Step(name, error.words, detail=failed, mood=BAD))
                    if attempt == attempts:
                        raise
                    self._wait(_READ_S)
