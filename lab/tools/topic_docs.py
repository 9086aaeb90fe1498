"""Write the tables of ``docs/topics.md`` from ``cardbox_tracker/ros/topics.csv``.

python -m lab.tools.topic_docs [--check]
"""

from __future__ import annotations

import argparse
import sys
from itertools import groupby
from pathlib import Path

from cardbox_tracker.ros.runtime.command_line import SERVICE, Entry, entries
from lab.pages import replaced, table

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "topics.md"
_TOPICS = ("topic", "direction", "type", "QoS", "what")
_SERVICES = ("service", "type", "what")


def _label(entry: Entry) -> str:
    """Return the words in the marks around the table of an entry."""
    kind = "services" if entry.direction == SERVICE else "topics"
    return f"{entry.node} {kind}{' with cameras' if entry.case else ''}"


def _cells(entry: Entry) -> tuple[str, ...]:
    of_topic = () if entry.direction == SERVICE else (entry.direction,)
    qos = () if entry.direction == SERVICE else (entry.qos,)
    return f"`{entry.name}`", *of_topic, entry.type, *qos, entry.content.replace("|", "\\|")


def document(text: str) -> str:
    """Return the document ``text`` with the present tables, without ``/diagnostics`` of all nodes.

    Raises:
        CardboxError: it lacks the marks of a table.
    """
    shown = (entry for entry in entries() if entry.name != "/diagnostics")
    for label, found in groupby(shown, _label):
        head = _SERVICES if "services" in label else _TOPICS
        marks = f"<!-- {label}:begin -->", f"<!-- {label}:end -->"
        text = replaced(text, table(head, map(_cells, found)), *marks)
    return text


def main(args: list[str] | None = None) -> int:
    """Write the document, or with ``--check`` only compare; 1 if it differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="only compare")
    given = parser.parse_args(args)
    before = DOCUMENT.read_text(encoding="utf-8")
    after = document(before)
    if after != before and not given.check:
        DOCUMENT.write_text(after, encoding="utf-8")
    return 1 if after != before and given.check else 0


if __name__ == "__main__":
    sys.exit(main())
