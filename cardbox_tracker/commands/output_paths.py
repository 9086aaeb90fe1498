"""Checks the outputs of subcommands before the work begins."""

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
    """Refuse outputs that cannot be written or would overwrite something, before any work is done.

    Args:
        outputs: files to write; None is ignored.
        force: whether files that exist may be replaced.
        inputs: files and recordings that are read, which are never replaced; None is ignored.
        results: files and folders that other code writes; only ``force`` and ``inputs`` are
            checked.

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


def body_beside(table: Path) -> Path:
    """Return the file beside a table of ``cardbox track --stature`` with the body that it used."""
    return table.with_name(f"{table.stem}.body.yaml")


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
