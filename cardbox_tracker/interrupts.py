"""Ctrl-C and SIGTERM end every program of the package without a traceback, however early they come.

Python turns Ctrl-C into an exception at whatever it does: an import, the construction of half an
executor, a destructor, whose exception nobody can catch. So nodes only take note of a signal, upon
which ROS shuts down, and the programs that have no ROS get the exception where they can handle it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NoReturn

INTERRUPTED = 130
"""Exit code of a command that a signal has ended."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Less than launch waits before it sends the next signal.
_PATIENCE_S = 4.0

_received = threading.Event()


def were_received() -> bool:
    """Return whether a signal has asked this program to end."""
    return _received.is_set()


def note() -> None:
    """Take note that a signal has come."""
    _received.set()


def leave_at_once(code: int | None = None) -> None:
    """From now on a signal ends the process with ``code``: for imports, when nothing is open.

    None is 128 and the signal's number, as shells have it.
    """

    def leave(number: int, _: FrameType | None) -> NoReturn:
        os._exit(128 + number if code is None else code)

    for number in _SIGNALS:
        signal.signal(number, leave)


def leave_interrupted() -> NoReturn:
    """End the process with :data:`INTERRUPTED`, once what it has printed is written.

    Returning to Python would not do: what it runs by ``-m`` it ends by SIGINT if Ctrl-C came within
    exec() of a text, as the definition of a dataclass has it, even if the exception was caught.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(INTERRUPTED)


def interrupt_commands() -> None:
    """From now on Ctrl-C raises KeyboardInterrupt; what SIGTERM does is ``commands/signals.py``."""

    def interrupt(_: int, __: FrameType | None) -> NoReturn:
        note()
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def only_noted() -> Iterator[None]:
    """Context in which signals raise nothing: rclpy, whose handler comes first, shuts ROS down.

    A program that has not ended some seconds later, such as one that still compiles its kernels,
    is ended. In another thread than the main one, which gets no signals, it does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def note(_: int, __: FrameType | None) -> None:
        if not _received.is_set():
            _received.set()
            timer = threading.Timer(_PATIENCE_S, _give_up)
            timer.daemon = True
            timer.start()

    before: dict[Any, Any] = {number: signal.signal(number, note) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            # While Python ends it has no handlers; launch and a terminal send one signal each, and
            # the second would then kill a process that has done all it should.
            signal.signal(number, signal.SIG_IGN if _received.is_set() else handler)


def _give_up() -> None:
    print("ended at once: it was busy for too long after the signal", file=sys.stderr, flush=True)
    os._exit(0)
