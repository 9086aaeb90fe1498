"""Guides a person through the reference postures: instruct, count down, capture, repeat.

The module is free of ROS; it shows, waits and captures by functions that the caller supplies.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import NamedTuple

from cardbox_tracker.common.errors import InitializationError

ASK, GOOD, BAD = "ask", "good", "bad"
"""Moods of a prompt: an instruction, a success or a failure."""

HOLD_STILL = "Hold still"
FINISHED, FAILED, CANCELLED = "Thank you. Done.", "That did not work. Sorry.", "Stopped."

_HOLD_S = 1.0
_READ_S = 2.0
# The last seconds are counted aloud for a person who stands sideways and cannot see them.
_SPOKEN_COUNT = 3


def instruction(name: str, side_turn: str) -> str:
    """Return the instruction for the reference ``front``, ``side`` or ``arms``."""
    return {
        "front": "face the camera, arms hanging a little away from the body",
        "side": f"turn a quarter to your {side_turn}, arms hanging a little away from the body",
        "arms": "face the camera, arms stretched sideways, just below the shoulders, hands open",
    }[name]


def short_words(name: str, side_turn: str) -> str:
    """Return a short instruction that can be read at two metres or spoken."""
    return {
        "front": "Face the camera, arms a little out",
        "side": f"Now turn {side_turn}, arms as before",
        "arms": "Face the camera, arms out sideways",
    }[name]


class Prompt(NamedTuple):
    """An instruction or a message of the guidance."""

    name: str  #: name of the reference, or ``measuring``
    words: str  #: short text for the person
    #: remaining seconds of the count-down; None if there is no count-down.
    left_s: int | None = None
    detail: str = ""  #: text for the operator; ``words`` if empty
    mood: str = ASK  #: ``ask``, ``good`` or ``bad``

    @property
    def text(self) -> str:
        """Line of text for the operator."""
        count = "" if self.left_s is None else f": {self.left_s}"
        return f"{self.name}: {self.detail or self.words}{count}"


def spoken(before: Prompt | None, now: Prompt) -> str:
    """Return the text to be spoken when ``now`` follows ``before``; it may be empty."""
    if before is None or before.words != now.words or before.name != now.name:
        return now.words
    if now.left_s is not None and now.left_s != before.left_s and now.left_s <= _SPOKEN_COUNT:
        return str(now.left_s)
    return ""


def measuring(fraction: float) -> Prompt:
    """Return the prompt during the measurement, of which ``fraction`` is done."""
    return Prompt("measuring", "Good. Measuring, you may relax", detail=f"{100 * fraction:.0f} %")


def guide(
    missing: Sequence[str],
    side_turn: str,
    count_down_s: int,
    attempts: int,
    show: Callable[[Prompt], None],
    capture: Callable[[str], str],
    wait: Callable[[float], None],
) -> None:
    """Guide a person through the ``missing`` references, each in up to ``attempts``.

    ``show`` shows a prompt, ``wait`` waits seconds, and ``capture`` captures a reference by name
    and returns a text, or raises InitializationError. So does this after the last attempt; an error
    of ``wait`` ends the guidance.
    """
    for name in missing:
        words, detail = short_words(name, side_turn), instruction(name, side_turn)
        for attempt in range(1, attempts + 1):
            for left in range(count_down_s, 0, -1):
                show(Prompt(name, words, left, detail))
                wait(1.0)
            show(Prompt(name, HOLD_STILL, detail="hold still"))
            wait(_HOLD_S)
            try:
                done = capture(name)
                show(Prompt(name, "Good.", detail=done, mood=GOOD))
                wait(_HOLD_S)
                break
            except InitializationError as error:
                failed = f"not captured: {error}"
                show(Prompt(name, error.words, detail=failed, mood=BAD))
                if attempt == attempts:
                    raise
                wait(_READ_S)


class Cancellation:
    """Allows one initialization at a time; :meth:`cancel` and :meth:`stop` end its waits."""

    def __init__(self) -> None:
        self._busy = threading.Lock()
        self._ended = threading.Event()
        self._is_stopped = False
        self._why = ""

    @property
    def is_running(self) -> bool:
        """Whether an initialization runs."""
        return self._busy.locked()

    def begin(self) -> bool:
        """Begin an initialization, which ends with :meth:`end`; return False if one is running."""
        if not self._busy.acquire(blocking=False):
            return False
        if not self._is_stopped:
            self._ended.clear()
        return True

    def end(self, success: bool) -> str:
        """End the initialization; return the last words to the person."""
        is_cancelled = self._ended.is_set()
        self._busy.release()
        if success:
            return FINISHED
        return CANCELLED if is_cancelled else FAILED

    def cancel(self) -> str:
        """End the running initialization; return the answer, or raise InitializationError."""
        if not self.is_running:
            raise InitializationError("nothing to cancel: no initialization is running")
        self._why = "the initialization was cancelled; call initialize to start again"
        self._ended.set()
        return "the initialization ends now; its own answer says so, too"

    def stop(self) -> None:
        """End the running initialization and all later ones."""
        self._why, self._is_stopped = "the initializer was stopped", True
        self._ended.set()

    def wait(self, duration_s: float) -> None:
        """Wait, s; raise InitializationError if the initialization was cancelled or stopped."""
        if self._ended.wait(duration_s):
            raise InitializationError(self._why)
