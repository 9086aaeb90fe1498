"""Topics and services of the nodes from ``topics.csv``, which their help and a document show."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

_TABLE = Path(__file__).parents[1] / "topics.csv"
SERVICE = "service"


class Entry(NamedTuple):
    """One topic or service of a node.

    Attributes:
        node: name of the node.
        case: settings with which it exists; empty for the default.
        direction: ``in``, ``out`` or ``service``.
        name: relative or absolute; words in capitals are values of parameters.
        type: such as ``sensor_msgs/Image``.
        qos: reliability, or ``latched``, and depth; empty for a service.
        content: phrase in Markdown.
    """

    node: str
    case: str
    direction: str
    name: str
    type: str
    qos: str
    content: str


def entries(node: str = "") -> list[Entry]:
    """Return the topics and services of a node, or of all nodes, in the order of the table."""
    with _TABLE.open(encoding="utf-8", newline="") as file:
        found = [Entry(**row) for row in csv.DictReader(file)]
    return [entry for entry in found if node in ("", entry.node)]
