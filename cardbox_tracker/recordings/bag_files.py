"""Finds the files of a bag, also without its metadata, and limits what they unpack to.

rosbags decompresses each chunk, message or file whole, without a limit. `check_recording` adds
up the sizes that a recording states; `limit_decompression` replaces the functions that rosbags
calls by ones that stop at a limit, because the stated sizes may be false.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import lz4.frame
from rosbags.interfaces import MessageDefinition
from rosbags.interfaces import MessageDefinitionFormat as _KIND
from rosbags.rosbag2 import reader, storage_mcap

from cardbox_tracker.common.errors import BagError
from cardbox_tracker.common.files import UnreadableFileError, read_regular

MOST_BYTES = 256 * 1024 * 1024
"""Limit of one chunk or message, several times the largest image."""
MOST_METADATA_BYTES = 1024 * 1024

# Recorders reach this ratio only with uniform images, for which MOST_BYTES suffices.
_MOST_RATIO = 300
_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _CHUNK_INDEX = 0x06, 0x08
_ALIAS = re.compile(rb"(?m)(?:^|[\s,\[{])\*[\w-]")
_STORAGES = (".mcap", ".db3")

# Untyped, because rosbags exports neither its decompressors nor its zstd module.
_READER: Any = reader
_MCAP: Any = storage_mcap


def check_recording(path: Path) -> None:
    """Raise BagError unless a recording is of regular files and states sensible unpacked sizes."""
    if path.is_dir():
        for name in sorted(os.listdir(path)):
            inside = path / name
            if inside.suffix in _STORAGES and not name.startswith(".") and not inside.is_file():
                raise BagError(f"{inside} is not a file; give a complete copy of the recording")
        _check_metadata(path / "metadata.yaml")
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    for file in files:
        if file.suffix == ".mcap" and not file.name.startswith("."):
            _check_chunks(file)


def _check_metadata(path: Path) -> None:
    if not path.is_file():
        raise BagError(f"{path} is not a file; give a complete copy of the recording")
    with path.open("rb") as file:
        data = file.read(MOST_METADATA_BYTES + 1)
    if len(data) > MOST_METADATA_BYTES or _ALIAS.search(data):
        raise BagError(
            f"{path} was not written by a recorder: it has YAML aliases or more than "
            f"{MOST_METADATA_BYTES} bytes; 'ros2 bag reindex' writes it again"
        )


def _check_chunks(path: Path) -> None:
    """Add up the unpacked sizes that the chunks and the index of an mcap file state."""
    unpacked = {_CHUNK: 0, _CHUNK_INDEX: 0}
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        for kind, bytes_unpacked in _unpacked_sizes(file, size):
            unpacked[kind] += bytes_unpacked
            if bytes_unpacked > MOST_BYTES:
                raise _too_large(path, bytes_unpacked)
    for total in unpacked.values():
        if total > max(MOST_BYTES, _MOST_RATIO * size):
            raise _too_large(path, total)


def _unpacked_sizes(file: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """Yield the record kind of each chunk and index entry, and its unpacked size in bytes."""
    at = len(_MAGIC)
    while at + 9 <= size:
        file.seek(at)
        kind, length = struct.unpack("<BQ", file.read(9))
        at += 9 + length
        # The reader refuses files that are cut off, and names the fault.
        if at > size:
            return
        if kind == _CHUNK and length >= 24:
            yield kind, struct.unpack("<QQQ", file.read(24))[2]
        elif kind == _CHUNK_INDEX and length >= 8:
            file.seek(at - 8)
            yield kind, struct.unpack("<Q", file.read(8))[0]


def _too_large(path: Path, size: int) -> BagError:
    return BagError(
        f"the recording {path} would unpack to {size / 1e6:.0f} MB, far more than its size allows; "
        "record it again with smaller chunks, or without compression"
    )


def read_other_channels() -> None:
    """Let rosbags, in this process, open files that also have JSON, protobuf or other channels."""
    _MCAP.get_msgdef = _definition
    _MCAP.read_string = lambda file: _MCAP.read_bytes(file).decode("utf-8", "replace")


def _definition(schema: Any) -> MessageDefinition:
    kinds = {"ros2msg": _KIND.MSG, "ros2idl": _KIND.IDL, "omgidl": _KIND.IDL}
    kind = _KIND.NONE if schema is None else kinds.get(schema.encoding, _KIND.NONE)
    return MessageDefinition(kind, "" if kind is _KIND.NONE else schema.data)


def limit_decompression() -> None:
    """Let rosbags, in this process, decompress through the limits of this module."""
    _MCAP.DECOMPRESSORS.update(zstd=unpack_zstd, lz4=unpack_lz4)
    _READER.zstd = SimpleNamespace(decompress=unpack_zstd, open=LimitedFile)


def _unpack(decompressor: Callable[[], Any], data: bytes, size: int = MOST_BYTES) -> bytes:
    """Decompress frames of at most ``size`` bytes in all; raise BagError beyond."""
    parts: list[bytes] = []
    left = most_bytes = min(size, MOST_BYTES)
    while data:
        frame = decompressor()
        parts.append(frame.decompress(data, max_length=left + 1))
        left -= len(parts[-1])
        if left < 0:
            raise BagError(f"a compressed part of it unpacks to more than {most_bytes} bytes")
        if not frame.eof:
            raise BagError("a compressed part of it is cut off")
        data = frame.unused_data
    return b"".join(parts)


unpack_zstd = partial(_unpack, _MCAP.zstd.ZstdDecompressor)
unpack_lz4 = partial(_unpack, lz4.frame.LZ4FrameDecompressor)


class LimitedFile(_MCAP.zstd.ZstdFile):  # type: ignore[misc]
    """A zstd file that raises BagError once it has unpacked to far more than its size."""

    def read(self, size: int | None = -1) -> bytes:
        """Return the next ``size`` unpacked bytes."""
        data: bytes = super().read(size)
        if self.tell() > max(MOST_BYTES, _MOST_RATIO * os.fstat(self.fileno()).st_size):
            raise BagError("a compressed file of it unpacks to far more than its size allows")
        return data


FILE_ENDINGS = (".mcap", ".db3", ".bag")
"""Endings of a recording's files."""

# rosbag2 numbers the parts of a recording; rosbag of ROS 1 also writes the time of each.
_PART = re.compile(r"(.*?)(?:_\d{4}(?:-\d\d){5})?_(\d+)")
# What recorders of some Humble versions leave empty, and channels that this reader leaves out.
_UNKNOWN_STORAGE = re.compile(r"(?m)^\s*storage_identifier:(?![ \t]*[\"']?(?:mcap|sqlite3)\b)")
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


def lone_parts(paths: Iterable[Path]) -> list[str]:
    """Return names of bags with the same name but for a number from 0 on: parts that lack others.

    Takes are usually counted from 1.
    """
    groups: dict[tuple[Path, str], dict[int, str]] = {}
    for path in filter(is_bag_file, paths):
        if (part := _PART.fullmatch(path.stem)) is not None:
            groups.setdefault((path.parent, part[1]), {})[int(part[2])] = path.name
    return [name for of in groups.values() if len(of) > 1 and 0 in of for name in of.values()]


def paths_to_open(folder: Path) -> list[Path]:
    """Return the folder of a bag if its metadata can be used, else its files; none if unknown."""
    metadata = folder / "metadata.yaml"
    if not metadata.exists():
        return files_of_one(folder)
    try:
        text = read_regular(metadata, MOST_METADATA_BYTES).decode("utf-8", "replace")
    except UnreadableFileError:
        return [folder]
    # rosbags takes every path that ends in ".bag" for a file of ROS 1.
    is_misnamed = folder.suffix == ".bag"
    if is_misnamed or _UNKNOWN_STORAGE.search(text) or _OTHER_FORMAT.search(text):
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
