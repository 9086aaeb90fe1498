"""Rate limit of repeated log messages, so that no input can fill a disk."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

_TEXTS = 3
_FIRST_PAUSE_S = 10.0
_LONGEST_PAUSE_S = 600.0


@dataclass
class _Spell:
    """Messages of one kind since its last quiet period."""

    texts: set[str] = field(default_factory=set)
    pause_s: float = _FIRST_PAUSE_S
    next_s: float = 0.0
    seen_s: float = 0.0


class LogLimit:
    """Allows the first texts of a kind, then one text after each of growing pauses.

    The kind is the fault without the numbers and names of its text, because a sender of always
    different nonsense would otherwise fill log and memory. A kind that was quiet for longer than
    its pause starts anew.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        """Measure time with ``now_s``, which returns seconds."""
        self._now_s = now_s
        self._spells: dict[str, _Spell] = {}

    def allows(self, kind: str, text: str) -> bool:
        """Return whether to log ``text``, and count it."""
        now_s = self._now_s()
        spell = self._spells.get(kind)
        if spell is None or now_s - spell.seen_s > 2 * spell.pause_s:
            spell = self._spells[kind] = _Spell()
        spell.seen_s = now_s
        is_new = text not in spell.texts and len(spell.texts) < _TEXTS
        if not is_new and now_s < spell.next_s:
            return False
        if is_new:
            spell.texts.add(text)
        else:
            spell.pause_s = min(2 * spell.pause_s, _LONGEST_PAUSE_S)
        spell.next_s = now_s + spell.pause_s
        return True
