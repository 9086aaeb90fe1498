"""What packages beside this one add by entry points: detectors, and formats of exports."""

from __future__ import annotations

from collections.abc import Container
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from cardbox_tracker.common.errors import CardboxError

DETECTORS, EXPORTERS = "detectors", "exporters"


def extensions(kind: str, taken: Container[str]) -> dict[str, EntryPoint]:
    """Return the entry points of the group ``cardbox_tracker.KIND`` by name; none is imported.

    Args:
        kind: ``DETECTORS`` or ``EXPORTERS``.
        taken: names of this package.

    Raises:
        CardboxError: two distributions add the same name, or one adds a name that is taken.
    """
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=f"cardbox_tracker.{kind}"):
        if entry.name in taken or entry.name in found:
            other = "cardbox_tracker" if entry.name in taken else _name_of(found[entry.name])
            raise CardboxError(
                f"{entry.name} of {kind} comes from {_name_of(entry)} and from {other}: uninstall "
                "one of the two"
            )
        found[entry.name] = entry
    return found


def loaded(entry: EntryPoint, kind: type | None = None) -> Any:
    """Return what an entry point names, of a ``kind`` if there is one.

    Raises:
        CardboxError: it cannot be imported, or is none; the text names its distribution.
    """
    try:
        found = entry.load()
    except Exception as error:
        raise CardboxError(
            f"{entry.name} of {_name_of(entry)} cannot be imported: {type(error).__name__}: "
            f"{error}; mend {entry.value}, or uninstall {_name_of(entry)}"
        ) from error
    if kind is not None and not isinstance(found, kind):
        raise CardboxError(
            f"{entry.name} of {_name_of(entry)} is no {kind.__name__} of {kind.__module__}: mend "
            f"{entry.value}, or uninstall {_name_of(entry)}"
        )
    return found


def _name_of(entry: EntryPoint) -> str:
    return "an unknown distribution" if entry.dist is None else entry.dist.name
