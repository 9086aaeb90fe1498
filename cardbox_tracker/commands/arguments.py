"""Argument types and options that several subcommands have, and the check of their outputs."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, dataclass, field, fields
from inspect import cleandoc
from itertools import chain
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from cardbox_tracker.common.errors import CardboxError, plain
from cardbox_tracker.common.files import check_writable, is_written_in_place
from cardbox_tracker.common.settings import settings_of

if TYPE_CHECKING:
    from cardbox_tracker.recordings.result_reader import Results
    from cardbox_tracker.recordings.silhouettes import TimeSpan

T = TypeVar("T")

REFERENCES = {
    "front": "faces the camera, arms hanging 20 degrees away from the body",
    "side": "stands the same, turned by 90 degrees",
    "arms": "faces the camera, both arms stretched sideways, hands open",
}
"""Reference postures by name, with the description for the person."""


def parsed(
    kind: Callable[[Any], T], expected: str, is_right: Callable[[T], bool] = lambda _: True
) -> Callable[[Any], T]:
    """Return a reader of texts, and of values of Python, by ``kind``.

    It raises ArgumentTypeError unless the value ``is_right``.
    """

    def read(given: Any) -> T:
        with suppress(ValueError, TypeError, OverflowError):
            value = kind(given)
            if is_right(value) and not isinstance(given, bool):
                return value
        raise argparse.ArgumentTypeError(f"expected {expected}, got {given!r}")

    return read


def _span(given: str | Iterable[float]) -> TimeSpan:
    from cardbox_tracker.recordings.silhouettes import TimeSpan

    return TimeSpan.parse(given if isinstance(given, str) else ":".join(map(str, given)))


span = parsed(_span, "T0:T1, seconds from the start of the recording with T0 before T1")
"""Reader of a span ``T0:T1``, or of its two times."""
time = parsed(float, "seconds from the start of the recording", lambda one: 0.0 <= one < math.inf)
"""Reader of a time."""
number = parsed(float, "a number")
"""Reader of a number."""
path = parsed(Path, "a path")
"""Reader of a path."""


def whole(given: Any) -> int:
    """Return a whole number, or raise ValueError or TypeError."""
    return int(given) if isinstance(given, str) else index(given)


def at_least(lowest: int) -> Callable[[Any], int]:
    """Return a reader of whole numbers of ``lowest`` or more."""
    return parsed(whole, f"a whole number of {lowest} or more", lambda one: one >= lowest)


def between(lowest: float, highest: float) -> Callable[[Any], float]:
    """Return a reader of numbers in a range, 0 excluded if it is the lowest."""
    least = "above" if lowest == 0.0 else "from"
    return parsed(
        float,
        f"a number {least} {lowest:g} to {highest:g}",
        lambda one: lowest <= one <= highest and not lowest == 0.0 == one,
    )


def _switch(given: Any) -> bool:
    if isinstance(given, bool):
        return given
    raise argparse.ArgumentTypeError(f"expected True or False, got {given!r}")


# Readers by the types of fields.
_READERS: dict[str, Callable[[Any], Any]] = {
    "Path": path,
    "float": number,
    "str": str,
    "bool": _switch,
}


def option(
    metavar: str | None = None,
    read: Callable[[Any], Any] | None = None,
    default: Any = None,
    flag: str = "",
    **words: Any,
) -> Any:
    """Return a field of :class:`Options`.

    ``read`` returns the value of a text, or of what Python gives; without it, the field's type
    tells. MISSING is no default; ``flag`` is the option if it has not the name of the field. The
    rest are arguments of ``add_argument``, such as the ``type`` of one of several words.
    """
    words = {"metavar": metavar, **words}
    return field(default=default, metadata={"words": words, "read": read, "flag": flag})


@dataclass(frozen=True)
class Options:
    """Base of the dataclasses whose fields are options: each is made by :func:`option`.

    What the docstring says of an attribute is also the help of its option. Python may give a value
    as it is typed, too. Raises CardboxError if one is wrong.
    """

    def __post_init__(self) -> None:
        """Read the values; None stands for the default."""
        for entry in fields(self):
            given = getattr(self, entry.name)
            is_given = given is not None and given is not entry.default
            value = _read(entry, given) if is_given else entry.default
            object.__setattr__(self, entry.name, value)

    @classmethod
    def of(cls, options: argparse.Namespace) -> Self:
        """Return the values of :func:`add_options`."""
        return cls(**{entry.name: getattr(options, entry.name) for entry in fields(cls)})

    def given(self) -> dict[str, Any]:
        """Return the values that are not the default, by their options."""
        values = ((entry, getattr(self, entry.name)) for entry in fields(self))
        return {_flag(entry): value for entry, value in values if value != entry.default}


def _helps(kind: type[Options]) -> dict[str, str]:
    """Return what the docstrings of a class and of its bases say of each attribute."""
    texts = "\n".join(cleandoc(each.__doc__ or "") for each in kind.__mro__)
    found = re.findall(r"(?m)^    (\w+): (.*(?:\n {8}.*)*)", texts)
    return {name: " ".join(text.split()) for name, text in found}


def _flag(entry: Field[Any]) -> str:
    flag: str = entry.metadata["flag"] or f"--{entry.name.replace('_', '-')}"
    return entry.name if entry.default is MISSING else flag


def _reader(entry: Field[Any]) -> Callable[[Any], Any]:
    found: Callable[[Any], Any] | None = entry.metadata["read"]
    return _READERS[str(entry.type).removesuffix(" | None")] if found is None else found


def _read(entry: Field[Any], given: Any) -> Any:
    choices = entry.metadata["words"].get("choices")
    try:
        if choices and given not in choices:
            shown = ", ".join(map(repr, choices))
            raise argparse.ArgumentTypeError(f"invalid choice: {given!r} (choose from {shown})")
        return _reader(entry)(given)
    except argparse.ArgumentTypeError as error:
        raise CardboxError(f"argument {_flag(entry)}: {error}") from None


def add_options(parser: Any, kind: type[Options], *names: str, **changed: dict[str, Any]) -> None:
    """Add an option to a parser for each field of ``kind``, or for those with these names.

    ``changed`` are other arguments of ``add_argument`` by the names of fields.
    """
    helps = _helps(kind)
    for entry in fields(kind):
        if names and entry.name not in names:
            continue
        words: dict[str, Any] = {"type": _reader(entry), "help": helps.get(entry.name)}
        if entry.default is not MISSING:
            default = None if entry.default == () else entry.default
            words |= {"dest": entry.name, "default": default}
        words |= entry.metadata["words"] | changed.get(entry.name, {})
        if entry.default is False:
            words = {"dest": entry.name, "help": words["help"], "action": "store_true"}
        parser.add_argument(_flag(entry), **words)


def add_references(parser: argparse.ArgumentParser) -> None:
    """Add the spans of the reference postures, and ``--side-turn``."""
    from cardbox_tracker.person.posture import SIDE_TURNS

    for name, posture in REFERENCES.items():
        parser.add_argument(
            f"--{name}",
            type=span,
            required=True,
            metavar="T0:T1",
            help=f"seconds during which the person {posture}",
        )
    parser.add_argument(
        "--side-turn",
        choices=SIDE_TURNS,
        default="left",
        help="which way the person turns for --side, as they see it",
    )


def add_seed(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--seed``; ``what`` names the random numbers that it determines."""
    parser.add_argument("--seed", type=at_least(0), default=0, help=f"random seed of {what}")


def add_camera_count(parser: argparse.ArgumentParser, several: str) -> None:
    """Add ``--cameras``, a number; ``several`` describes the purpose of more than one."""
    parser.add_argument(
        "--cameras",
        type=int,
        choices=range(1, 5),
        default=1,
        metavar="N",
        help=f"1 to 4; {several}",
    )


def add_settings(parser: argparse.ArgumentParser, kind: Any, title: str) -> None:
    """Add an option, a switch for a bool, for each setting of ``kind``, below ``title``."""
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
    """Return the settings of the dataclass ``kind`` from the options of :func:`add_settings`."""
    try:
        return kind(**{name: getattr(options, name) for name in settings_of(kind)})
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        raise CardboxError(f"--{name.replace('_', '-')} {rest}") from None


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add ``--force``."""
    parser.add_argument(
        "--force", action="store_true", help="replace results that exist; without it, refuse"
    )


def check_outputs(
    outputs: Iterable[Path | None],
    force: bool,
    inputs: Sequence[Path | None] = (),
    results: Iterable[Path | None] = (),
) -> None:
    """Refuse outputs that cannot be written or would overwrite something, before any work is done.

    None is ignored everywhere. ``inputs`` are read, so they are never replaced; ``outputs`` and
    ``results`` only with ``force``. ``results`` are files and folders that other code writes.
    """
    files = [path for path in outputs if path is not None]
    every = [*files, *(path for path in results if path is not None)]
    for number, path in enumerate(every):
        for other in every[:number]:
            is_same = path.absolute() == other.absolute() or _is_same(path, other)
            if is_same and not is_written_in_place(path):
                raise CardboxError(f"{path} is given for two outputs; give each a name of its own")
        for read in _files_of(inputs):
            if _is_same(path, read):
                raise CardboxError(f"cannot write {path}: it is read, as {read}; give another name")
    for path in files:
        check_writable(path)
    for path in every:
        if not force and _is_something(path):
            raise CardboxError(f"{path} exists; choose another name, or give --force to replace it")


def _is_something(path: Path) -> bool:
    """Return whether there is a file, or a folder with content, that would be lost."""
    if path.is_dir():
        return any(path.iterdir())
    return path.exists() and not is_written_in_place(path)


def _files_of(inputs: Iterable[Path | None]) -> Iterator[Path]:
    for path in inputs:
        if path is None:
            continue
        yield path
        if path.is_dir():
            # The recording of a session is in a subfolder.
            yield from path.glob("*")
            yield from (path / "bag").glob("*")


def _is_same(path: Path, other: Path) -> bool:
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False


def add_results(parser: argparse.ArgumentParser) -> None:
    """Add ``RESULTS``, and ``--person``, the number of one of several people in them."""
    parser.add_argument(
        "results",
        type=Path,
        metavar="RESULTS",
        help="table of 'cardbox track' (CSV or Parquet), or its bag",
    )
    parser.add_argument(
        "--person",
        type=at_least(1),
        metavar="K",
        help="results of several people: the number of the person (default: 1)",
    )


def results_of(path: Path, person: int | None) -> Results:
    """Return the results of a person, or of the first one of several, which is said."""
    from cardbox_tracker.recordings.result_reader import read_results

    results = read_results(path, person)
    if results.has_others and person is None:
        print_remarks([f"{path} has several people: person 1 is used; --person K gives another"])
    return results


def print_remarks(*remarks: Iterable[str]) -> None:
    """Print remarks on a recording on the standard error."""
    for remark in chain(*remarks):
        print(f"cardbox: {plain(remark)}", file=sys.stderr)
