"""Settings of the core as options of a subcommand: name, range and text are those of the core."""

from __future__ import annotations

import argparse
from dataclasses import fields
from typing import Any, TypeVar

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.settings import settings_of

T = TypeVar("T")


def add_settings(parser: argparse.ArgumentParser, kind: Any, title: str) -> None:
    """Add an option for each setting of the dataclass ``kind``, below the heading ``title``.

    A switch is off by default.
    """
    group = parser.add_argument_group(title)
    defaults = {entry.name: entry.default for entry in fields(kind)}
    for name, setting in settings_of(kind).items():
        flag, default = f"--{name.replace('_', '-')}", defaults[name]
        text = setting.description.replace("%", "%%")
        if isinstance(default, bool):
            group.add_argument(flag, action="store_true", help=text)
            continue
        unit = f" [{setting.unit}]" if setting.unit else ""
        if setting.choices:
            group.add_argument(flag, choices=setting.choices, default=default, help=text)
            continue
        allowed = f"; {setting.range_text}" if setting.range_text else ""
        group.add_argument(
            flag, type=type(default), default=default, metavar="N", help=f"{text}{unit}{allowed}"
        )


def settings_from(options: argparse.Namespace, kind: type[T]) -> T:
    """Return the settings of the dataclass ``kind`` that options give.

    Raises:
        CardboxError: a value is out of its range.
    """
    try:
        return kind(**{name: getattr(options, name) for name in settings_of(kind)})
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        raise CardboxError(f"--{name.replace('_', '-')} {rest}") from None
