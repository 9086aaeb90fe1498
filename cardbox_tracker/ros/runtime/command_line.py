"""Command lines of the nodes, and help with all parameters, topics and services of a node."""

from __future__ import annotations

import argparse
import csv
import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from cardbox_tracker.ros.runtime.node import CardboxNode, own_arguments, run_node
from cardbox_tracker.ros.runtime.parameter_fields import (
    NodeParameters,
    default_of,
    details,
    type_name,
    yaml_value,
)

_TABLE = Path(__file__).parents[1] / "topics.csv"
SERVICE = "service"


class Entry(NamedTuple):
    """One topic or service of a node."""

    node: str  #: name of the node
    case: str  #: settings with which it exists; empty for the default
    direction: str  #: ``in``, ``out`` or ``service``
    name: str  #: relative or absolute; words in capitals are values of parameters
    type: str  #: such as ``sensor_msgs/Image``
    qos: str  #: reliability, or ``latched``, and depth; empty for a service
    content: str  #: phrase in Markdown


def entries(node: str = "") -> list[Entry]:
    """Return the topics and services of a node, or of all nodes, in the order of the table."""
    with _TABLE.open(encoding="utf-8", newline="") as file:
        found = [Entry(**row) for row in csv.DictReader(file)]
    return [entry for entry in found if node in ("", entry.node)]


_WIDTH = 96
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")


def node_main(
    name: str, node: Callable[[], CardboxNode], parameters: type[NodeParameters], nice: int = 0
) -> Callable[[list[str] | None], int]:
    """Return the function ``main`` of a node, whose exit code is 0 unless it could not start.

    It takes ROS arguments only, and its help begins with the docstring of the parameters. ``nice``
    lowers the priority of the process.
    """

    def main(args: list[str] | None = None) -> int:
        command_line = list(sys.argv) if args is None else [name, *args]
        words = f"Everything else is a ROS argument: {name} --ros-args -p PARAMETER:=VALUE."
        does = (parameters.__doc__ or "").partition("\n")[0]
        parser = argparse.ArgumentParser(
            prog=name, description=does, **node_help(name, parameters, words)
        )
        parser.parse_args(own_arguments(command_line))
        os.nice(nice)
        return run_node(node, command_line)

    return main


def node_help(name: str, parameters: type[NodeParameters], words: str) -> dict[str, Any]:
    """Return arguments of an ArgumentParser whose help ends with what the node has."""
    lines = [*textwrap.wrap(words, _WIDTH), *_parameters(parameters), *_topics(entries(name))]
    # The parser takes a percent sign for a place of its own.
    text = "\n".join(lines).replace("%", "%%")
    return {"epilog": text, "formatter_class": argparse.RawDescriptionHelpFormatter}


def _parameters(kind: type[NodeParameters]) -> Iterator[str]:
    yield from ("", "parameters (type = default; unit; allowed values; effect of a change):")
    types = kind.types()
    for name, spec in kind.specs().items():
        default = yaml_value(default_of(kind, name))
        yield f"  {name} ({type_name(types[name])} = {default}; {details(spec)})"
        yield from _indented(spec.description)


def _topics(found: list[Entry]) -> Iterator[str]:
    topics = [entry for entry in found if entry.direction != SERVICE]
    services = [entry for entry in found if entry.direction == SERVICE]
    yield from ("", "topics (direction, name, type, quality of service):")
    for entry in topics:
        case = f" [{entry.case}]" if entry.case else ""
        yield f"  {entry.direction:3} {entry.name} ({entry.type}; {entry.qos}){case}"
        yield from _indented(entry.content)
    if services:
        yield from ("", "services:")
    for entry in services:
        yield f"  {entry.name} ({entry.type})"
        yield from _indented(entry.content)


def _indented(text: str) -> list[str]:
    plain = _LINK.sub(r"\1", text).replace("`", "")
    margin = " " * 6
    return textwrap.wrap(plain, _WIDTH, initial_indent=margin, subsequent_indent=margin)
