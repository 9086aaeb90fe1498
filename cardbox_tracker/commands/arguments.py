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
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from cardbox_tracker.common.errors import CardboxError, plain, quoted, reason_of
from cardbox_tracker.common.files import check_writable, is_written_in_place
from cardbox_tracker.common.settings import Setting, check

if TYPE_CHECKING:
    from cardbox_tracker.recordings.result_reader import Results
    from cardbox_tracker.recordings.silhouettes import TimeSpan

T = TypeVar("T")


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
        raise argparse.ArgumentTypeError(f"expected {expected}, got {quoted(given)}")

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


camera_count = parsed(whole, "a number from 1 to 4", lambda one: 1 <= one <= 4)
"""Reader of a number of cameras."""


def one_of(names: Iterable[str]) -> Callable[[Any], Any]:
    """Return a reader of one of several texts."""
    return parsed(str, f"one of {', '.join(names)}", lambda one: one in names)


def _switch(given: Any) -> bool:
    if isinstance(given, bool):
        return given
    raise argparse.ArgumentTypeError(f"expected True or False, got {quoted(given)}")


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
    tells. MISSING is no default; ``flag`` is the option if it has not the name of the field, and
    without hyphens a place. The rest are arguments of ``add_argument``, such as the ``type`` of one
    of several words.
    """
    words = {"metavar": metavar, **words}
    return field(default=default, metadata={"words": words, "read": read, "flag": flag})


def choice(names: Iterable[str], **given: Any) -> Any:
    """Return a field of :class:`Options` for one of several texts."""
    return option(f"{{{','.join(names)}}}", one_of(names), **given)


@dataclass(frozen=True)
class Options:
    """Base of the dataclasses whose fields are options: made by :func:`option`, or settings.

    What the docstring says of an attribute is also the help of its option. Python may give a value
    as it is typed, too. Raises CardboxError if one is wrong.
    """

    #: heading of the settings, or of the fields of the class itself
    group: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Read the values; None stands for the default."""
        for entry in fields(self):
            given = getattr(self, entry.name)
            value = entry.default if given is None else given
            if value is not entry.default and "read" in entry.metadata:
                try:
                    value = _reader(entry)(given)
                except argparse.ArgumentTypeError as error:
                    raise CardboxError(f"argument {_flag(entry)}: {error}") from None
                except (TypeError, ValueError) as error:
                    raise CardboxError(
                        f"argument {_flag(entry)}: {reason_of(error)}, got {quoted(given)}"
                    ) from None
            object.__setattr__(self, entry.name, value)
        try:
            check(self)
        except ValueError as error:
            name, _, rest = str(error).partition(" ")
            raise CardboxError(f"--{name.replace('_', '-')} {rest}") from None

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
    texts = "\n".join(cleandoc(each.__doc__ or "") for each in reversed(kind.__mro__))
    found = re.findall(r"(?m)^    (\w+): (.*(?:\n {8}.*)*)", texts)
    return {name: " ".join(text.split()) for name, text in found}


def _flag(entry: Field[Any]) -> str:
    flag: str = entry.metadata.get("flag") or f"--{entry.name.replace('_', '-')}"
    return entry.name if entry.default is MISSING else flag


def _reader(entry: Field[Any]) -> Callable[[Any], Any]:
    found: Callable[[Any], Any] | None = entry.metadata["read"]
    return _READERS[str(entry.type).removesuffix(" | None")] if found is None else found


def _words_of(one: Setting, default: Any) -> dict[str, Any]:
    unit = f" [{one.unit}]" if one.unit else ""
    text = one.description.replace("%", "%%") + unit
    if one.choices:
        return {"help": text, "choices": one.choices}
    allowed = f"; {one.range_text}" if one.range_text else ""
    return {"help": f"{text}{allowed}", "type": type(default), "metavar": "N"}


def add_options(parser: argparse.ArgumentParser, kind: type[Options], *names: str) -> None:
    """Add an option to a parser for each field of ``kind``, or for those with these names."""
    helps, group = _helps(kind), parser.add_argument_group(kind.group) if kind.group else parser
    for entry in fields(kind):
        if names and entry.name not in names:
            continue
        flag, default, words = _flag(entry), entry.default, dict[str, Any]()
        if flag.startswith("-"):
            words = {"dest": entry.name, "default": None if default == () else default}
        if (one := entry.metadata.get("setting")) is not None:
            words |= _words_of(one, default)
        else:
            words |= {"type": _reader(entry), "help": helps.get(entry.name)}
            words |= entry.metadata["words"]
        if isinstance(default, bool):
            action = "store_false" if default else "store_true"
            words = {"dest": entry.name, "help": words["help"], "action": action}
        is_own = one is not None or entry.name in vars(kind)
        (group if is_own else parser).add_argument(flag, **words)


@dataclass(frozen=True, kw_only=True)
class Written(Options):
    """A command that writes results.

    Attributes:
        force: replace results that exist; without it, refuse
    """

    force: bool = option(default=False)


@dataclass(frozen=True, kw_only=True)
class TrackedResults(Options):
    """Results of tracking.

    Attributes:
        results: table of 'cardbox track' (CSV or Parquet), or its bag
        person: results of several people: the number of the person (default: 1)
    """

    results: Path = option("RESULTS", default=MISSING)
    person: int | None = option("K", at_least(1))

    def read(self) -> Results:
        """Return the results of the person, or of the first one of several, which is said."""
        from cardbox_tracker.recordings.result_reader import read_results

        results = read_results(self.results, self.person)
        if results.has_others and self.person is None:
            told = "has several people: person 1 is used; --person K gives another"
            print_remarks([f"{self.results} {told}"])
        return results


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


def print_remarks(*remarks: Iterable[str]) -> None:
    """Print remarks on a recording on the standard error."""
    for remark in chain(*remarks):
        print(f"cardbox: {plain(remark)}", file=sys.stderr)
