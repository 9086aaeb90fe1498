"""Finds the files of a bag, also without the metadata that its recorder writes last."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import BagError
from cardbox_tracker.common.files import UnreadableFileError, read_regular
from cardbox_tracker.recordings.bag_limits import MOST_METADATA_BYTES

FILE_ENDINGS = (".mcap", ".db3", ".bag")
"""Endings of a recording's files."""

# rosbag2 numbers the parts of a recording; rosbag of ROS 1 also writes the time of each.
_PART = re.compile(r"(.*?)(?:_\d{4}(?:-\d\d){5})?_(\d+)")
# What recorders of some Humble versions leave empty, and channels that this reader leaves out.
_UNKNOWN_STORAGE = re.compile(r"(?m)^\s*storage_identifier:\s*(?:\"\"|''|~|null)?\s*$")
_OTHER_FORMAT = re.compile(r"(?m)^\s*serialization_format:\s*(?!\"?'?cdr\b)\S")
_MOST_APART_NS = 60_000_000_000


def is_bag_file(path: Path) -> bool:
    """Return whether a path is that of a bag's file; hidden files are none."""
    return path.suffix in FILE_ENDINGS and not path.name.startswith(".")


def files_of_one(folder: Path) -> list[Path]:
    """Return the parts of the only bag in a folder without metadata, in order; none of several."""
    files = [path for path in folder.iterdir() if is_bag_file(path) and path.is_file()]
    if len(files) < 2:
        return files
    found = [_PART.fullmatch(path.stem) for path in files]
    parts = {int(part[2]): path for part, path in zip(found, files, strict=True) if part}
    names = {(part and part[1], path.suffix) for part, path in zip(found, files, strict=True)}
    if len(names) > 1 or sorted(parts) != list(range(len(files))):
        return []
    return [parts[number] for number in range(len(files))]


def paths_to_open(folder: Path) -> list[Path]:
    """Return the folder of a bag if its metadata can be used, else its files; none if unknown."""
    metadata = folder / "metadata.yaml"
    if not metadata.exists():
        return files_of_one(folder)
    try:
        text = read_regular(metadata, MOST_METADATA_BYTES).decode("utf-8", "replace")
    except UnreadableFileError:
        return [folder]
    if _UNKNOWN_STORAGE.search(text) or _OTHER_FORMAT.search(text):
        return files_of_one(folder) or [folder]
    return [folder]


def check_parts(path: Path, readers: Sequence[Any]) -> None:
    """Raise BagError if parts of a recording do not follow each other in time."""
    for before, after in pairwise(readers):
        apart_ns = after.start_time - before.end_time
        if before.message_count and after.message_count and abs(apart_ns) > _MOST_APART_NS:
            raise BagError(
                f"{path} has no metadata.yaml, and {after.path.name} begins {apart_ns / 1e9:.0f} s "
                f"after the end of {before.path.name}, so they are no parts of one recording; put "
                f"each into a folder of its own, or join them: 'ros2 bag reindex {path}'"
            )
