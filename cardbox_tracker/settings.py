"""Settings of the core: what each does, its unit, its range, declared once with its default.

A field of a settings dataclass is made by :func:`setting`; the parameters of the nodes and their
documentation take all of it from there.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Setting:
    """Description of one setting besides its name, type and default.

    Attributes:
        description: what it does, one sentence.
        unit: its unit; empty for a plain number or a text.
        minimum: smallest allowed value; None without a limit.
        maximum: largest allowed value; None without a limit.
        choices: the allowed texts; empty if any text is.
        restarts: True if tracking has to start again when it changes.
    """

    description: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    restarts: bool = False

    @property
    def limits(self) -> tuple[float, float] | None:
        """Smallest and largest allowed value; None without limits."""
        if self.minimum is None or self.maximum is None:
            return None
        return self.minimum, self.maximum

    @property
    def range_text(self) -> str:
        """The allowed values in words, or an empty text."""
        if self.choices:
            return " | ".join(choice or '""' for choice in self.choices)
        return "" if self.limits is None else " to ".join(map(_short, self.limits))

    def check(self, name: str, value: Any) -> None:
        """Check a value; None stands for "not set" and is always allowed.

        Raises:
            ValueError: it is not allowed; the text has ``name``, the value and what is allowed.
        """
        if value is None:
            return
        if self.choices and value not in self.choices:
            raise ValueError(f"{name} is '{value}'; expected one of {', '.join(self.choices)}")
        if self.limits is not None:
            lowest, highest = self.limits
            if not lowest <= value <= highest:  # so written, "not a number" is refused too
                raise ValueError(f"{name} is {value:g}; expected {lowest:g} to {highest:g}")


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
    lowest, highest = limits or (None, None)
    made = Setting(description, unit, lowest, highest, choices, restarts)
    return field(default=default, metadata={"setting": made})


def settings_of(kind: Any) -> dict[str, Setting]:
    """Return the settings of a dataclass or an instance of one, by name, in order."""
    return {
        entry.name: entry.metadata["setting"]
        for entry in fields(kind)
        if "setting" in entry.metadata
    }


def check(instance: Any) -> None:
    """Check every setting of a dataclass instance.

    Raises:
        ValueError: a value is not allowed; the text names it.
    """
    for name, one in settings_of(instance).items():
        one.check(name, getattr(instance, name))


def restarts(old: Any, new: Any) -> bool:
    """Return whether tracking has to start again when ``old`` settings become ``new`` ones.

    Both are instances of one dataclass; the fields that are no settings, such as nested settings,
    are compared as a whole.
    """
    known = settings_of(old)
    return any(
        getattr(old, entry.name) != getattr(new, entry.name)
        for entry in fields(old)
        if entry.name not in known or known[entry.name].restarts
    )


def _short(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:g}"
