"""Settings of the core as options of a subcommand, with the core's names, ranges and texts."""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

from cardbox_tracker.commands.arguments import at_least
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.settings import NoEffectError, nested, settings_of

if TYPE_CHECKING:
    from cardbox_tracker.estimation.config import TrackerConfig

T = TypeVar("T")

# Settings of the tracker that have an option, and the option of each.
_OPTIONS = MappingProxyType(
    {
        "strategy": "--strategy",
        "torso.particles": "--particles",
        "arm.particles": "--particles",
        "whole_body.effort": "--effort",
    }
)


def add_tracker_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options that change the preset's settings of the tracker."""
    from cardbox_tracker.estimation.filtering.resampling import STRATEGIES
    from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig

    parser.add_argument(
        "--strategy",
        choices=STRATEGIES,
        default=None,
        help="resampling of the preset paper; drs, the paper's deterministic one, by default",
    )
    parser.add_argument(
        "--particles",
        type=at_least(2),
        default=None,
        metavar="N",
        help="particles of each of the three filters of the preset paper; 200 by default",
    )
    effort = settings_of(WholeBodyConfig)["effort"]
    parser.add_argument(
        "--effort",
        type=float,
        default=None,
        metavar="X",
        help=f"{effort.description}; {effort.range_text}; for the preset default",
    )
    parser.add_argument(
        "--settings",
        type=Path,
        default=None,
        metavar="FILE.yaml",
        help="further settings of the tracker by name, as docs/parameters.md lists them; options "
        "take precedence over the file",
    )


def with_tracker_settings(config: TrackerConfig, options: argparse.Namespace) -> TrackerConfig:
    """Return ``config`` changed by the options of :func:`add_tracker_settings`.

    Raises:
        CardboxError: the file cannot be read, or a value is wrong or has no effect.
    """
    from cardbox_tracker.estimation.settings_file import read_settings

    if options.settings is not None:
        config = read_settings(options.settings, config)
    values = {
        name: getattr(options, option[2:].replace("-", "_")) for name, option in _OPTIONS.items()
    }
    given = {name: value for name, value in values.items() if value is not None}
    try:
        return config.changed(nested(given))
    except NoEffectError as error:
        raise CardboxError(error.renamed(_OPTIONS)) from None
    except ValueError as error:
        text = str(error)
        for name, option in _OPTIONS.items():
            text = text.replace(name, option)
        raise CardboxError(text) from None


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
    """Return the settings of the dataclass ``kind`` from the options.

    Raises:
        CardboxError: a value is out of its range.
    """
    try:
        return kind(**{name: getattr(options, name) for name in settings_of(kind)})
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        raise CardboxError(f"--{name.replace('_', '-')} {rest}") from None
