"""What other packages add: detectors and formats by entry points, and optional libraries."""

from __future__ import annotations

from collections.abc import Callable, Container
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from cardbox_tracker.common.errors import CardboxError, cut

R = TypeVar("R")

DETECTORS, EXPORTERS = "detectors", "exporters"


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

    It may end with anything, such as what ends a program.
    """
    try:
        return call()
    except (CardboxError, KeyboardInterrupt):
        raise
    except BaseException as error:
        try:
            why = cut(str(error))
        except Exception:
            why = "its text is unknown"
        raise CardboxError(f"{what}: {type(error).__name__}: {why}{expected}") from error


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
