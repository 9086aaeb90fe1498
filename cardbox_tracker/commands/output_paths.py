"""What the subcommands that write something ask of their outputs, before they begin."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import check_writable, is_written_in_place


def add_force(parser: argparse.ArgumentParser) -> None:
    """Add ``--force``."""
    parser.add_argument(
        "--force", action="store_true", help="replace results that exist; without it, refuse"
    )


def check_outputs(
    outputs: Iterable[Path | None],
    force: bool,
    inputs: Sequence[Path | None] = (),
    results: Iterable[Path] = (),
) -> None:
    """Refuse what could not be written, or would destroy something, before any work is done.

    Args:
        outputs: files to write; None are left out.
        force: whether files that exist may be replaced.
        inputs: files and recordings that are read; they are never replaced. None are left out.
        results: files and folders that are written in ways of their own: only ``force`` and
            ``inputs`` are looked at.

    Raises:
        CardboxError: an output exists, is an input, is named twice, or cannot be written.
    """
    files = [path for path in outputs if path is not None]
    every = [*files, *results]
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
    """Whether there is a file, or a folder with anything in it, that would be lost."""
    if path.is_dir():
        return any(path.iterdir())
    return path.exists() and not is_written_in_place(path)


def _files_of(inputs: Iterable[Path | None]) -> Iterator[Path]:
    for path in inputs:
        if path is None:
            continue
        yield path
        if path.is_dir():
            # A session's folder has its recording in a folder of its own.
            yield from path.glob("*")
            yield from (path / "bag").glob("*")


def _is_same(path: Path, other: Path) -> bool:
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False
