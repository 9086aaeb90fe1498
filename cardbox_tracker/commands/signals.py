"""Makes SIGTERM and SIGHUP end a command like Ctrl-C, without incomplete files."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from cardbox_tracker import interrupts

# SIGTERM is sent by 'kill', a time limit or a shutdown, SIGHUP by a closed terminal.
_SIGNALS = (signal.SIGTERM, signal.SIGHUP)


class Terminated(KeyboardInterrupt):
    """The process was asked to end by a signal other than Ctrl-C's.

    Attributes:
        signal: number of the signal.
    """

    def __init__(self, number: int) -> None:
        """Keep the signal's number."""
        super().__init__()
        self.signal = number


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Raise :class:`Terminated` on signals that end the process; ignored ones stay ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in _SIGNALS}
    changed = {number: handler for number, handler in before.items() if handler == signal.SIG_DFL}
    for number in changed:
        signal.signal(number, _terminate)
    try:
        yield
    finally:
        for number, handler in changed.items():
            signal.signal(number, handler)


def _terminate(number: int, _: FrameType | None) -> None:
    interrupts.note()
    raise Terminated(number)
