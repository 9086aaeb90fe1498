"""Response of all programs to signals, which end them without a traceback at any time.

Python raises an exception for Ctrl-C at any place: in an import, in a destructor, within a
constructor of rclpy. The functions of this module choose the response: during imports, a signal
ends the process; a command raises KeyboardInterrupt where it can clean up; a running node leaves
the signal to rclpy, which shuts ROS down.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from types import FrameType
from typing import Literal, NoReturn


@dataclass
class _State:
    """The response to signals."""

    #: end the process, raise KeyboardInterrupt, or only note the signal.
    response: Literal["end", "raise", "note"] = "end"
    #: exit code of an ended process; None for 128 plus the signal's number, as in a shell.
    code: int | None = None
    received: int = 0  #: number of the first signal; 0 before it


_state = _State()

end_process = os._exit
"""Ends this process at once, also while foreign code runs."""


def received() -> int:
    """Return the number of the first signal that this program received; 0 without any."""
    return _state.received


def end_at_once(code: int | None = None) -> None:
    """Let SIGINT and SIGTERM end imports with ``code``; None is 128 plus the signal's number."""
    _state.response, _state.code = "end", code
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _handle)


@contextmanager
def raised() -> Iterator[None]:
    """Context in which SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt.

    Ignored signals stay ignored. The context has no effect outside of the main thread, because only
    the main thread receives signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    handled = {n: handler for n, handler in before.items() if handler is not signal.SIG_IGN}
    for number in handled:
        signal.signal(number, _handle)
    _state.received = 0
    try:
        with _responding("raise"):
            yield
    finally:
        for number, handler in handled.items():
            signal.signal(number, handler)


@contextmanager
def only_noted() -> Iterator[None]:
    """Context in which signals raise nothing; the handler of rclpy stays and shuts ROS down."""
    with _responding("note"):
        yield


@contextmanager
def withheld() -> Iterator[None]:
    """Context that holds signals back until its end; processes started in it never receive SIGINT.

    Ctrl-C reaches all processes of a terminal, and one that is still importing prints a traceback.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        # A thread that does not block the signal can receive it, too.
        with _responding("note"):
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if _state.response == "raise" and _state.received:
        raise KeyboardInterrupt


def ignore() -> None:
    """Ignore SIGINT and SIGTERM while DDS leaves the network: Python ends without handlers."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def leave(code: int) -> NoReturn:
    """Write all output and end the process with ``code``, without the finalization of Python.

    Python ends ``python -m`` by SIGINT after a Ctrl-C within exec(), even if it was caught. A node
    needs the finalization of Python, which takes its participant off the network.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    end_process(code)


@contextmanager
def _responding(response: Literal["raise", "note"]) -> Iterator[None]:
    before, _state.response = _state.response, response
    try:
        yield
    finally:
        _state.response = before


def _handle(number: int, _: FrameType | None) -> None:
    _state.received = _state.received or number
    if _state.response == "end":
        end_process(128 + number if _state.code is None else _state.code)
    if _state.response == "raise":
        raise KeyboardInterrupt
