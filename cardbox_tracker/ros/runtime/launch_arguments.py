"""Arguments of the launch files: their types, checks and error texts.

``ros2 launch`` runs under the system's Python, which does not see the nodes' virtual environment.
Therefore this module imports only the standard library.
"""

from __future__ import annotations

import difflib
import fnmatch
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.common.errors import CardboxError, quoted

_PACKAGE = "cardbox_tracker"
# ``ros2 launch`` passes these options on like arguments.
_OF_LAUNCH = ("launch-prefix", "launch-prefix-filter")

Value = bool | int | float | str | list[float] | list[str]

_EXPECTED = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    list: "a list of numbers such as [6.5, 9.5]",
    Path: "a file that exists, or nothing",
}


@dataclass(frozen=True)
class Argument:
    """One argument of a launch file."""

    #: default as text; None if the argument is required. A number whose default is empty may be
    #: left out.
    default: str | None
    meaning: str  #: one line for ``--show-args``
    #: type of its value; ``list`` is a list of numbers, ``Path`` the name of a file to read
    kind: type = str
    choices: tuple[str, ...] = ()  #: allowed texts; empty if any text is allowed
    limits: tuple[float, float] | None = None  #: lowest and highest allowed number
    #: True if the value must be empty, or a letter followed by letters, digits and underscores. In
    #: a list, this holds for each item, and all must differ.
    name: bool = False

    def value(self, text: str) -> Value | None:
        """Return the value of ``text``, None if left out, or raise ValueError: the expectation."""
        expected = " or ".join(self.choices) if self.choices else _EXPECTED.get(self.kind, "")
        lowest, highest = self.limits or (-math.inf, math.inf)
        if self.limits is not None:
            expected += f" from {lowest:g} to {highest:g}"
        if self.name and self.kind is list:
            return _names(text)
        if self.name:
            expected = "a letter, then letters, digits and underscores, or nothing"
        if self.kind is float and self.default == text.strip() == "":
            return None
        found = _parsed(self.kind, text.strip())
        if (
            found is None
            or (self.choices and found not in self.choices)
            or (self.name and not re.fullmatch(r"([A-Za-z]\w*)?", text, re.ASCII))
            or any(
                not lowest <= one <= highest
                for one in (found if isinstance(found, list) else [found])
                if isinstance(one, int | float)
            )
        ):
            raise ValueError(expected)
        return found


def values(arguments: Mapping[str, Argument], given: Mapping[str, str]) -> dict[str, Value | None]:
    """Return the value of each of ``arguments``, or raise CardboxError with all that are wrong."""
    found: dict[str, Value | None] = {}
    wrong = []
    for name, argument in arguments.items():
        try:
            found[name] = argument.value(given[name])
        except ValueError as error:
            wrong.append(f"launch argument {name} is {quoted(given[name])}; expected {error}")
    if wrong:
        raise CardboxError("; ".join(wrong))
    return found


def shares_process(given: Mapping[str, str]) -> bool:
    """Return whether background, initializer, tracker and source share a process.

    With ``single_process:=auto``, the default, they do, unless there are several cameras or the
    detector makes the silhouettes.
    """
    text = given.get("single_process", "auto").strip().lower()
    if text != "auto":
        return text == "true"
    is_one = not given.get("cameras", "").strip(" []")
    return is_one and given.get("silhouettes", "background") == "background"


def parameters_in(sections: object, node: str) -> dict[str, object]:
    """Return the parameters of a node, by its full name, in the content of a parameter file.

    The parsed YAML maps names of nodes, with wildcards, to ``ros__parameters``. Raises ValueError,
    with the expectation, if it has another form.
    """
    if not isinstance(sections, Mapping):
        raise ValueError("a mapping from names of nodes to ros__parameters")
    found: dict[str, object] = {}
    for name, section in sections.items():
        own = section.get("ros__parameters") if isinstance(section, Mapping) else None
        if not isinstance(own, Mapping):
            raise ValueError(f"ros__parameters below {quoted(name)}, as one mapping")
        # Two asterisks stand for any number of namespaces, also for none.
        pattern = "/" + str(name).lstrip("/").replace("**/", "*").replace("**", "*")
        if fnmatch.fnmatchcase(node, pattern):
            found |= own
    return found


def check_names(file: str, known: Iterable[str], command_line: Sequence[str]) -> None:
    """Raise CardboxError for arguments of the launch file ``file`` that are not ``known``.

    ``ros2 launch`` accepts any name and ignores a misspelt one. If another launch file includes
    this one, the command line belongs to the other file, and nothing is checked.
    """
    names = sorted(known)
    given = [word.partition(":=")[0] for word in _arguments_of(file, command_line) if ":=" in word]
    unknown = sorted(set(given).difference(names, _OF_LAUNCH))
    if not unknown:
        return
    near = [one for name in unknown for one in difflib.get_close_matches(name, names, 1)]
    raise CardboxError(
        f"{Path(file).name} has no launch argument {', '.join(map(quoted, unknown))}"
        + (f"; did you mean {', '.join(near)}? It has " if near else "; it has ")
        + ", ".join(names)
    )


def _arguments_of(file: str, command_line: Sequence[str]) -> Sequence[str]:
    """Return the words after the launch file ``file``, or none if another file was started."""
    for place, (before, word) in enumerate(zip(["", *command_line], command_line, strict=False)):
        by_package = before == _PACKAGE and word == Path(file).name
        if by_package or (Path(word).is_file() and Path(word).samefile(file)):
            return command_line[place + 1 :]
    return ()


def _parsed(kind: type, text: str) -> Value | None:
    if kind is bool:
        return {"true": True, "false": False}.get(text.lower())
    if kind is list:
        words = text.removeprefix("[").removesuffix("]").split(",")
        numbers = [_number(word) for word in words if word.strip()]
        return None if None in numbers else [one for one in numbers if one is not None]
    if kind is Path:
        return text if not text or Path(text).expanduser().is_file() else None
    if kind is float:
        return _number(text)
    if kind is int:
        try:
            return int(text)
        except ValueError:
            return None
    return text


def _names(text: str) -> list[str]:
    """Return the names in a list such as [left, right]; raise ValueError if it is not a list."""
    words = text.strip().removeprefix("[").removesuffix("]").split(",")
    names = [word.strip().strip("/") for word in words if word.strip()]
    wrong = [name for name in names if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII)]
    if wrong or len(set(names)) < len(names):
        raise ValueError("a list of different names such as [left, right], or nothing")
    return names


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
