"""Argument types and options that several subcommands have, and the check of their outputs."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import fields
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

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
    kind: Callable[[str], T], expected: str, is_right: Callable[[T], bool] = lambda _: True
) -> Callable[[str], T]:
    """Return a parser of ``kind`` that raises ArgumentTypeError unless the value ``is_right``."""

    def parse(text: str) -> T:
        with suppress(ValueError):
            value = kind(text)
            if is_right(value):
                return value
        raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")

    return parse


def _span(text: str) -> TimeSpan:
    from cardbox_tracker.recordings.silhouettes import TimeSpan

    return TimeSpan.parse(text)


span = parsed(_span, "T0:T1, seconds from the start of the recording with T0 before T1")
"""Parser of a span ``T0:T1``."""
time = parsed(float, "seconds from the start of the recording", lambda one: 0.0 <= one < math.inf)
"""Parser of a time."""


def at_least(lowest: int) -> Callable[[str], int]:
    """Return a parser of whole numbers of ``lowest`` or more."""
    return parsed(int, f"a whole number of {lowest} or more", lambda one: one >= lowest)


def between(lowest: float, highest: float) -> Callable[[str], float]:
    """Return a parser of numbers in a range, 0 excluded if it is the lowest."""
    least = "above" if lowest == 0.0 else "from"
    return parsed(
        float,
        f"a number {least} {lowest:g} to {highest:g}",
        lambda one: lowest <= one <= highest and not lowest == 0.0 == one,
    )


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


def add_preset(parser: argparse.ArgumentParser) -> None:
    """Add ``--preset``, a name of ``search.config.PRESETS``."""
    from cardbox_tracker.search.config import PRESETS

    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default="default",
        help="tracker settings: paper is Table I of the paper, default tracks best",
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


def add_camera_pitch(parser: argparse.ArgumentParser, found: str = "") -> None:
    """Add ``--camera-pitch-deg``, None by default if ``found`` says how it is found, else 0."""
    text = "positive when the camera looks down"
    parser.add_argument(
        "--camera-pitch-deg",
        type=float,
        default=None if found else 0.0,
        metavar="P",
        help=f"{text} (default: {found})" if found else text,
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
