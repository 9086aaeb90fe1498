"""What other packages add: detectors and formats by entry points, and optional libraries."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, NoReturn, TypeVar

from cardbox_tracker.common.errors import CardboxError, cut
from cardbox_tracker.common.interrupts import end_process

R = TypeVar("R")

DETECTORS, EXPORTERS = "detectors", "exporters"

_lock = threading.Lock()
# The working directory, opened once more for each call of foreign code that runs.
_folders: list[int] = []


class _Thread(threading.local):
    """What a thread does; its copy in another process does something else."""

    foreign_in = 0  #: process in which it runs foreign code


_thread = _Thread()


def extensions(kind: str, taken: Container[str]) -> dict[str, EntryPoint]:
    """Return the entry points of ``DETECTORS`` or ``EXPORTERS`` by name, without importing them.

    Raises CardboxError if a name comes from two distributions, or is one of those ``taken``.
    """
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=f"cardbox_tracker.{kind}"):
        if entry.name in taken or entry.name in found:
            other = place_of(found[entry.name]) if entry.name in found else "cardbox_tracker"
            raise CardboxError(
                f"{entry.name} of {kind} comes from {place_of(entry)} and from {other}: uninstall "
                "one of the two"
            )
        found[entry.name] = entry
    return found


def loaded(entry: EntryPoint) -> Any:
    """Return what an entry point names; CardboxError, with its distribution, if that fails."""
    what = f"{entry.name} of {place_of(entry)} cannot be imported from {entry.value}"
    return called(entry.load, what)


def called(call: Callable[[], R], what: str, expected: str = "") -> R:
    """Return what foreign code returns; if it fails, raise CardboxError that begins with ``what``.

    It may change the working directory, and end with anything, such as what ends a program.
    """
    streams = [one for one in (sys.stdout, sys.stderr) if not getattr(one, "closed", True)]
    try:
        with _confined():
            found = call()
        if any(one.closed for one in streams):
            raise OSError("it closes the standard output")
        return found
    except (CardboxError, KeyboardInterrupt):
        raise
    except BaseException as error:
        try:
            why = cut(str(error))
        except BaseException:
            why = "its text is unknown"
        raise CardboxError(f"{what}: {type(error).__name__}: {why}{expected}") from error


@contextmanager
def _confined() -> Iterator[None]:
    """Context of foreign code that neither ends this process nor moves its working directory."""
    before = _thread.foreign_in
    with _lock:
        # Another call may already have moved it.
        _folders.append(os.dup(_folders[0]) if _folders else os.open(".", os.O_RDONLY))
        os._exit = _exit
    _thread.foreign_in = os.getpid()
    try:
        yield
    finally:
        _thread.foreign_in = before
        with _lock:
            folder = _folders.pop()
            os.fchdir(folder)
            os.close(folder)
            if not _folders:
                os._exit = end_process


def _exit(status: int) -> NoReturn:
    """End this process in place of ``os._exit``, but from foreign code raise SystemExit."""
    if _thread.foreign_in == os.getpid():
        raise SystemExit(status)
    end_process(status)


def place_of(entry: EntryPoint) -> str:
    """Return the distribution from which an entry point comes."""
    return entry.dist.name if entry.dist else "the command line"


def optional(name: str, needs: str, extra: str, instead: str = "") -> Any:
    """Return a module that ``pip`` installs with an extra of this package, or raise CardboxError.

    ``needs`` says what needs it, and ``instead`` what is possible without it.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise CardboxError(
            f"{needs} ({error}); install it with pip install 'cardbox_tracker[{extra}]'{instead}"
        ) from None
