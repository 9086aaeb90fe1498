"""No recording of a few kB may fill the memory: what is compressed in it is bounded.

rosbags decompresses a chunk or message whole, whatever its size; here its functions for that are
replaced by some that stop where more comes out than the recording says or than is sensible.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import lz4.frame
from rosbags.rosbag2 import reader, storage_mcap

from cardbox_tracker.errors import BagError

MOST_BYTES = 256 * 1024 * 1024
"""Of one chunk or message: the largest image there is, several times over."""
MOST_METADATA_BYTES = 1024 * 1024

# Recordings compress by less, but for those of nothing at all, which MOST_BYTES is enough for.
_MOST_RATIO = 300
# Some decompressors take the memory before they know whether they need it.
_PIECE_BYTES = 4 * 1024 * 1024
_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _CHUNK_INDEX = 0x06, 0x08
_ALIAS = re.compile(rb"(?m)(?:^|[\s,\[{])\*[\w-]")
_STORAGES = (".mcap", ".db3")


# What rosbags does not say that it offers, mypy would not let be used.
_READER: Any = reader
_MCAP: Any = storage_mcap


def check_sizes(path: Path) -> None:
    """Refuse a recording whose files are none, or that would unpack to far more than it is.

    Raises:
        BagError: it is such a one.
    """
    if path.is_dir():
        for name in sorted(os.listdir(path)):
            inside = path / name
            if inside.suffix in _STORAGES and not inside.is_file():
                raise BagError(f"{inside} is no file; give a recording that was copied whole")
        _check_metadata(path / "metadata.yaml")
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    for file in files:
        if file.suffix == ".mcap":
            _check_chunks(file)


def _check_metadata(path: Path) -> None:
    if not path.is_file():
        raise BagError(f"{path} is no file; give a recording that was copied whole")
    with path.open("rb") as file:
        data = file.read(MOST_METADATA_BYTES + 1)
    if len(data) > MOST_METADATA_BYTES or _ALIAS.search(data):
        raise BagError(
            f"{path} is not what a recorder writes: it is very large or has aliases; "
            "'ros2 bag reindex' remakes it"
        )


def _check_chunks(path: Path) -> None:
    """Add up what the chunks and the index of an mcap file say that they unpack to."""
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
    """Yield the kind of each chunk or entry of the index, and what it unpacks to, bytes."""
    at = len(_MAGIC)
    while at + 9 <= size:
        file.seek(at)
        kind, length = struct.unpack("<BQ", file.read(9))
        at += 9 + length
        # Damaged files are refused by the reader, which says what is wrong.
        if at > size:
            return
        if kind == _CHUNK and length >= 24:
            yield kind, struct.unpack("<QQQ", file.read(24))[2]
        elif kind == _CHUNK_INDEX and length >= 8 and at <= size:
            file.seek(at - 8)
            yield kind, struct.unpack("<Q", file.read(8))[0]


def _too_large(path: Path, size: int) -> BagError:
    return BagError(
        f"the recording {path} would unpack to {size / 1e6:.0f} MB, far more than it holds; record "
        "it again with smaller chunks, or without compression"
    )


def unpack(data: bytes, most_bytes: int, make: Callable[[], Any]) -> bytes:
    """Return what a decompressor makes of ``data``, frame by frame.

    Args:
        data: compressed.
        most_bytes: that may come out.
        make: returns a decompressor, with the interface of the standard library's.

    Raises:
        BagError: more comes out, or ``data`` ends before it.
    """
    parts: list[bytes] = []
    left = most_bytes
    while data:
        decompressor, given = make(), data
        while not decompressor.eof:
            # One byte more than fits, so that whatever is too long is seen.
            parts.append(decompressor.decompress(given, max_length=min(left + 1, _PIECE_BYTES)))
            given = b""
            left -= len(parts[-1])
            if left < 0:
                raise BagError(f"something in it unpacks to more than {most_bytes} bytes")
            if decompressor.needs_input and not decompressor.eof:
                raise BagError("something in it is compressed and cut off")
        data = decompressor.unused_data
    return b"".join(parts)


def _zstd(data: bytes, size: int = MOST_BYTES) -> bytes:
    return unpack(data, min(size, MOST_BYTES), _MCAP.zstd.ZstdDecompressor)


def _lz4(data: bytes, size: int = MOST_BYTES) -> bytes:
    return unpack(data, min(size, MOST_BYTES), lz4.frame.LZ4FrameDecompressor)


class _Bounded:
    """A compressed file from which no more is read than it can sensibly hold."""

    def __init__(self, compressed: BinaryIO, file: Any) -> None:
        self._file = file
        self._left = max(MOST_BYTES, _MOST_RATIO * os.fstat(compressed.fileno()).st_size)

    def read(self, count: int = -1) -> bytes:
        data: bytes = self._file.read(min(count, self._left + 1) if count >= 0 else self._left + 1)
        self._left -= len(data)
        if self._left < 0:
            raise BagError("its file unpacks to far more than it holds")
        return data

    def __enter__(self) -> _Bounded:
        self._file.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._file.__exit__(*error)


def _open(compressed: BinaryIO, mode: str) -> _Bounded:
    return _Bounded(compressed, _MCAP.zstd.open(compressed, mode))


_MCAP.DECOMPRESSORS.update(zstd=_zstd, lz4=_lz4)
_READER.zstd = SimpleNamespace(decompress=_zstd, open=_open)
