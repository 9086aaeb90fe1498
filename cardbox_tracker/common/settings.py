"""Declaration of settings: default, description, unit and range of each, at one place.

:func:`setting` makes a field of a settings dataclass, a :class:`Settings`. The parameters of the
nodes and their documentation are generated from these fields.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import partial
from numbers import Real
from typing import Any, TypeVar

from cardbox_tracker.common.errors import quoted

T = TypeVar("T")

# Numbers below this are shown as floats, and whole ones can be one.
_LARGE = 1e15
_TYPE_TEXTS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


@dataclass(frozen=True)
class Setting:
    """Properties of a setting in addition to name, type and default."""

    description: str  #: its effect, in one sentence or phrase
    unit: str = ""  #: its unit; empty for a plain number or a text
    limits: tuple[float, float] | None = None  #: smallest and largest allowed value, if there are
    choices: tuple[str, ...] = ()  #: the allowed texts; empty if any text is allowed
    restarts: bool = False  #: True if tracking has to start again when it changes

    @property
    def range_text(self) -> str:
        """The allowed values as text; empty without limits and choices."""
        if self.choices:
            return " | ".join(choice or '""' for choice in self.choices)
        return "" if self.limits is None else " to ".join(map(_short, self.limits))

    def check(self, name: str, value: Any) -> None:
        """Check a value; None stands for "not set" and is always allowed.

        Raises:
            ValueError: it is not allowed; the text has ``name``, the value and the allowed values.
        """
        if value is None:
            return
        if self.choices and value not in self.choices:
            raise ValueError(
                f"{name} is {quoted(value)}; expected one of {', '.join(self.choices)}"
            )
        if self.limits is not None:
            lowest, highest = self.limits
            is_number = isinstance(value, Real)
            if not (is_number and lowest <= value <= highest):  # this form refuses NaN, too
                # A whole number may be too large for a float.
                shown = f"{value:g}" if is_number and abs(value) < _LARGE else quoted(value)
                raise ValueError(f"{name} is {shown}; expected {lowest:g} to {highest:g}")


class NoEffectError(ValueError):
    """A given setting has no effect together with the others.

    Attributes:
        name: of the setting.
        where: condition under which it has no effect, such as ``with the strategy drs``.
        instead: names of settings that have an effect.
    """

    def __init__(self, name: str, where: str, instead: str) -> None:
        """See the attributes."""
        super().__init__(f"{name} has no effect {where}; use {instead}")
        self.name, self.where, self.instead = name, where, instead


def setting(
    default: Any,
    description: str,
    *,
    unit: str = "",
    limits: tuple[float, float] | None = None,
    choices: tuple[str, ...] = (),
    restarts: bool = False,
) -> Any:
    """Return a dataclass field with a default and its :class:`Setting`."""
    made = Setting(description, unit, limits, choices, restarts)
    return field(default=default, metadata={"setting": made})


restarting = partial(setting, restarts=True)
"""A :func:`setting` with which tracking has to start again when it changes."""


def settings_of(kind: Any) -> dict[str, Setting]:
    """Return the settings of a dataclass or an instance of one, by name, in order."""
    return {
        entry.name: entry.metadata["setting"]
        for entry in fields(kind)
        if "setting" in entry.metadata
    }


def settings_below(instance: Any, before: str = "") -> Iterator[tuple[str, Any, Setting]]:
    """Yield dotted name, value and properties of every setting, also of nested ones.

    Args:
        instance: the settings.
        before: prefix of the names, such as ``whole_body.``.
    """
    known = settings_of(instance)
    for entry in fields(instance):
        name, value = f"{before}{entry.name}", getattr(instance, entry.name)
        if isinstance(value, tuple):
            for one in value:
                if is_dataclass(one):
                    yield from settings_below(one, f"{name}.{type(one).__name__}.")
        elif isinstance(value, Settings):
            yield from settings_below(value, f"{name}.")
        elif entry.name in known:
            yield name, value, known[entry.name]


def check(instance: Any) -> None:
    """Check every setting of a dataclass instance, and the classes of nested settings.

    Raises ValueError if a value is not allowed; the text names it.
    """
    for name, one in settings_of(instance).items():
        one.check(name, getattr(instance, name))
    for entry in fields(instance):
        default, value = entry.default, getattr(instance, entry.name)
        if isinstance(default, Settings | tuple):
            of_kind(entry.name, value, type(default) if isinstance(default, Settings) else Sequence)


def of_kind(name: str, value: Any, kind: type[T]) -> T:
    """Return a value that is of a class; ValueError, which names it, if it is not."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} is {quoted(value)}; expected an instance of {kind.__name__}")
    return value


def all_of_kind(name: str, values: Iterable[Any], kind: type[T]) -> tuple[T, ...]:
    """Return values that are all of a class; ValueError, which names them, if they are not."""
    if not isinstance(values, Iterable):
        raise ValueError(f"{name} are {quoted(values)}; expected a list of {kind.__name__}")
    return tuple(of_kind(f"{name}[{number}]", one, kind) for number, one in enumerate(values))


def settings_or(default: T, given: T | None, name: str = "config") -> T:
    """Return settings that are given, or the default ones; ValueError if they are of no such."""
    return default if given is None else of_kind(name, given, type(default))


class Settings:
    """Base of settings dataclasses: the ranges are checked when one is made.

    Raises ValueError if a value is not allowed; the text names it.
    """

    def __post_init__(self) -> None:
        """Check every setting."""
        check(self)


def changed(instance: T, given: Mapping[str, Any], where: str = "") -> T:
    """Return a settings dataclass with other values.

    Args:
        instance: the settings to change; they stay as they are.
        given: values by the names of the fields. Nested settings are mappings in turn; a tuple of
            settings is given as a mapping by the names of their classes.
        where: prefix of names in errors, such as ``whole_body.``.

    Raises:
        ValueError: a name is unknown, a value has the wrong type or is out of range; the text has
            the whole name and the expected value.
    """
    # Other fields are constants, which a program may replace but no user sets.
    known = {
        entry.name: getattr(instance, entry.name)
        for entry in fields(instance)  # type: ignore[arg-type]
        if "setting" in entry.metadata
        or isinstance(getattr(instance, entry.name), (Settings, tuple))
    }
    values: dict[str, Any] = {}
    for name, value in _mapping(given, where or "config").items():
        _check_name(name, known, where)
        before, whole = known[name], f"{where}{name}"
        if isinstance(before, tuple):
            values[name] = _changed_parts(before, value, whole)
        elif isinstance(before, Settings):
            values[name] = changed(before, _mapping(value, whole), f"{whole}.")
        else:
            values[name] = _typed(before, value, whole)
    try:
        return replace(instance, **values)  # type: ignore[type-var]
    except ValueError as error:
        raise ValueError(f"{where}{error}") from None


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by dotted names, such as ``whole_body.effort``, as nested mappings.

    Raises ValueError if a name is given a value, and settings below it, too.
    """
    result: dict[str, Any] = {}
    for dotted, value in values.items():
        *outer, name = str(dotted).split(".")
        inner = result
        for part in outer:
            inner = inner.setdefault(part, {})
            if not isinstance(inner, dict):
                raise ValueError(f"{part} is {quoted(inner)}; expected names and values below it")
        inner[name] = value
    return result


def _changed_parts(before: tuple[Any, ...], given: Any, where: str) -> tuple[Any, ...]:
    """Return settings of several classes with other values, by the names of the classes."""
    parts = {type(one).__name__: one for one in before}
    for name, values in _mapping(given, where).items():
        _check_name(name, parts, f"{where}.")
        whole = f"{where}.{name}"
        parts[name] = changed(parts[name], _mapping(values, whole), f"{whole}.")
    return tuple(parts.values())


def _check_name(name: Any, known: Mapping[str, Any], where: str) -> None:
    if name in known:
        return
    raise ValueError(
        f"{quoted(f'{where}{name}')} is no setting; {suggestion(name, known)}expected one of "
        f"{', '.join(known) or 'none'}"
    )


def suggestion(name: object, known: Iterable[str]) -> str:
    """Return "did you mean ...? " with the known name nearest to ``name``; empty without one."""
    near = difflib.get_close_matches(str(name), list(known), 1)
    return f"did you mean '{near[0]}'? " if near else ""


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{where} is {quoted(value)}; expected names and values below it")
    return value


def _typed(before: Any, value: Any, where: str) -> Any:
    """Return a value of the type of ``before``; a whole number may stand for a float."""
    if isinstance(before, float) and type(value) is int and abs(value) < _LARGE:
        return float(value)
    if type(value) is not type(before):
        raise ValueError(f"{where} is {quoted(value)}; expected {_TYPE_TEXTS[type(before)]}")
    return value


def restarts(old: Any, new: Any) -> bool:
    """Return whether tracking has to start again after a change from ``old`` to ``new`` settings.

    Both are instances of one dataclass. Fields that are not settings, such as nested settings, are
    compared as a whole.
    """
    known = settings_of(old)
    return any(
        getattr(old, entry.name) != getattr(new, entry.name)
        for entry in fields(old)
        if entry.name not in known or known[entry.name].restarts
    )


def _short(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:g}"
