"""Finds the recordings in a folder."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from cardbox_tracker.common.errors import CardboxError, plain
from cardbox_tracker.recordings.bag_files import files_of_one, is_bag_file
from cardbox_tracker.recordings.image_folder import image_files
from cardbox_tracker.recordings.video_reader import SUFFIXES as VIDEO_ENDINGS

SUMMARY = "_summary.csv"
"""Name of the summary in a folder of results, by which such folders are left out."""

FORMULA = ("=", "+", "-", "@")
"""What spreadsheets take for the beginning of a formula."""

_DEEPEST = 50


def is_one_recording(path: Path) -> bool:
    """Return whether a path is a single recording, not a folder of them.

    A folder is one if it or its ``bag`` is a rosbag2, if it has just one bag or the parts of one,
    or if it has images and no rosbag2 in its folders.
    """
    if not path.is_dir() or _is_rosbag2(path):
        return True
    if files_of_one(path):
        return True
    return bool(image_files(path)) and not any(map(_is_rosbag2, path.iterdir()))


def _is_rosbag2(path: Path) -> bool:
    return any((folder / "metadata.yaml").is_file() for folder in (path, path / "bag"))


def recordings_in(folder: Path, output: Path | None = None) -> dict[str, Path]:
    """Return the recordings in and below ``folder``, which is none itself, by name, in order.

    A name is the path from ``folder`` on, with "/". It has the ending of the file only where
    another recording would have the same name. Hidden entries, folders of results and ``output``
    are left out, and links to folders are followed only if they are recordings. Raises CardboxError
    if a folder cannot be read, or folders are nested too deep.
    """
    left_out = None if output is None else output.resolve()
    paths = {path.relative_to(folder): path for path in _found(folder, left_out, 0)}
    short = {path: path if paths[path].is_dir() else path.with_suffix("") for path in paths}
    count = Counter([*short.values(), *paths])
    names = {
        (short[path] if count[short[path]] == 1 + (short[path] == path) else path).as_posix(): path
        for path in paths
    }
    return {_plain(name): paths[names[name]] for name in sorted(names)}


def _found(folder: Path, left_out: Path | None, depth: int) -> Iterator[Path]:
    if depth > _DEEPEST:
        raise CardboxError(
            f"{folder} is nested more than {_DEEPEST} folders deep; give the folder that "
            "has the recordings"
        )
    try:
        with os.scandir(folder) as entries:
            names = sorted(entry.name for entry in entries if not entry.name.startswith("."))
        if SUMMARY in names:
            return
        for path in (folder / name for name in names):
            if path.is_file():
                if is_bag_file(path) or path.suffix.lower() in VIDEO_ENDINGS:
                    yield path
            elif path.is_dir() and path.resolve() != left_out:
                if is_one_recording(path):
                    yield path
                elif not path.is_symlink():
                    yield from _found(path, left_out, depth + 1)
    except OSError as error:
        raise CardboxError(
            f"cannot read the folder {folder}: {error.strerror}; give a folder whose "
            "folders can be read"
        ) from None


def _plain(name: str) -> str:
    """Return a name that a table, a terminal and a spreadsheet show as it is."""
    shown = plain(name).replace("\n", "\\n")
    return f"./{shown}" if shown.startswith(FORMULA) else shown
