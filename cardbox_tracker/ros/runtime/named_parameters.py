"""Parameters of one node, by its name, that hold in every namespace.

``rcl`` takes the name of ``-p tracker:stature:=1.7``, and of a section ``tracker:`` of a file, for
``/tracker``, and drops the value without a word if a namespace is given with ``-r __ns:=/x``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

_RULE = re.compile(r"(\w+):([^:=]+):=(.*)", re.DOTALL)
_SECTION = re.compile(
    r"^(\w+)(?=:[ \t]*(?:#.*)?\n(?:[ \t]*(?:#.*)?\n)*[ \t]+ros__parameters:)", re.M
)


def in_every_namespace(command_line: Sequence[str], folder: Path) -> list[str]:
    """Return a command line whose parameters of named nodes are in files, written to ``folder``.

    What cannot be read stays as it is, since rcl says what is wrong with it.
    """
    done, is_of_ros = list(command_line), False
    for place, (word, value) in enumerate(pairwise([*command_line, ""])):
        if word in ("--ros-args", "--"):
            is_of_ros = word == "--ros-args"
        elif is_of_ros and word in ("-p", "--param", "--params-file"):
            text = _of_file(value) if word == "--params-file" else _of_rule(value)
            if text:
                file = folder / f"{place}.yaml"
                file.write_text(text, encoding="utf-8")
                done[place : place + 2] = ["--params-file", str(file)]
    return done


def _of_rule(rule: str) -> str:
    found = _RULE.fullmatch(rule)
    if found is None:
        return ""
    node, name, value = found.groups()
    return f"/**/{node}:\n  ros__parameters:\n    {name}: {value}\n"


def _of_file(path: str) -> str:
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, ValueError):
        return ""
    return _SECTION.sub(r"/**/\1", text) if _SECTION.search(text) else ""
