"""Atomic writing of files: a reader finds the complete file or none; reading within a limit."""

from __future__ import annotations

import contextlib
import csv
import errno
import fcntl
import io
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from cardbox_tracker.common.errors import CardboxError, quoted, reason_of

# Part of the names of temporary files, which can remain after a crash.
_MARK = ".unfinished-"
_STEM_LENGTH = 100
# A background of 4096x4096, the largest working size, has 235 MB.
_MOST_BYTES = 256 * 1024 * 1024
# Characters of the names of a table's columns.
_LONGEST_HEAD = 100_000
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class UnreadableFileError(CardboxError):
    """A file cannot be opened, is not regular or too large; the text does not name the file."""


@contextmanager
def foreign(
    path: str | os.PathLike[str], kind: type[CardboxError], expected: str
) -> Iterator[None]:
    """Turn any error of a reader of files that others wrote into the package's own.

    Raises CardboxError if reading failed; one that names the file stays as it is.
    """
    name = os.fspath(path)
    try:
        yield
    except Exception as error:
        if isinstance(error, CardboxError) and name in str(error):
            raise
        raise kind(f"cannot read {name}: {reason_of(error)}; expected {expected}") from None


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` with the same suffix, and rename it at the end.

    If ``path`` is a link, its target is replaced. If it is a pipe or a device, such as
    ``/dev/stdout``, the content is copied to it at the end. Temporary files for the same ``path``
    are removed if their writer was killed. After an exception ``path`` is unchanged. Raises
    CardboxError if ``path`` or its folder cannot be written.
    """
    if is_written_in_place(path):
        with _copied_to(Path(path)) as temporary:
            yield temporary
        return
    target = resolved(path)
    with claimed_name(target, is_folder=False) as temporary, room_for(target):
        yield temporary
        with contextlib.suppress(OSError):
            # The new file keeps the permissions of the previous one.
            os.chmod(temporary, stat.S_IMODE(target.stat().st_mode))
        os.replace(temporary, target)


def write_file(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a text, in UTF-8, or bytes to :func:`atomic_path`."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def room_for(target: Path) -> Iterator[None]:
    """Turn the error of a full disk, a quota or a limit into CardboxError that names ``target``."""
    try:
        yield
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise CardboxError(
            f"cannot write {target}: {error.strerror}; make room, or give another folder"
        ) from None


@contextmanager
def saved_file(path: str | os.PathLike[str], kind: type[CardboxError]) -> Iterator[BinaryIO]:
    """Yield a file that replaces ``path`` when it is on the disk; raise ``kind`` if that fails."""
    try:
        with atomic_path(path) as temporary, temporary.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
    except CardboxError as error:
        raise kind(str(error)) from None
    except OSError as error:
        raise kind(
            f"cannot write {os.fspath(path)}: {error.strerror}; choose a folder that exists and is "
            "writable, on a disk with space"
        ) from None


@contextmanager
def claimed_name(target: Path, *, is_folder: bool) -> Iterator[Path]:
    """Yield a new empty file or folder beside ``target``, and remove it at the end if it exists.

    Its name is unpredictable, and no existing file is opened. It is locked while this process
    lives, so that the next run can recognize files of killed processes. Raises CardboxError if the
    folder of ``target`` cannot be written.
    """
    _remove_leftovers(target)
    name = f".{target.stem[:_STEM_LENGTH]}{_MARK}{secrets.token_hex(8)}{target.suffix}"
    temporary = target.with_name(name)
    try:
        if is_folder:
            temporary.mkdir()
            descriptor = os.open(temporary, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        else:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
            descriptor = os.open(temporary, flags, 0o666)
    except OSError as error:
        raise _refused(target, error) from None
    try:
        _lock(descriptor)
        yield temporary
    finally:
        _remove(temporary)
        os.close(descriptor)


def resolved(path: str | os.PathLike[str]) -> Path:
    """Return the file to write, a link's target; CardboxError for a folder or a circular link."""
    target = Path(path)
    if target.is_dir():
        raise CardboxError(f"cannot write {target}: it is a folder; give the name of a file")
    if not target.is_symlink():
        return target
    end = Path(os.path.realpath(target))
    if end.is_symlink():
        raise CardboxError(f"cannot write {target}: it is a circular link; remove it")
    return end


def make_folder(path: Path) -> None:
    """Make a folder unless there is one; raise CardboxError if that is not possible."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CardboxError(f"cannot make the folder {path}: {error.strerror}") from None


def user_path(name: str) -> Path:
    """Return the path of a user's text, with ``~`` replaced by a home folder.

    Raises CardboxError if the user after ``~`` does not exist.
    """
    try:
        return Path(name).expanduser()
    except RuntimeError:
        raise CardboxError(f"{name}: there is no such user; give the full path") from None


@contextmanager
def regular_file(path: str | os.PathLike[str], most_bytes: int = _MOST_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of at most ``most_bytes`` for reading; it never waits for a pipe.

    Raises UnreadableFileError if the file cannot be opened, is not a regular file, or is larger.
    """
    try:
        # Without O_NONBLOCK, opening a pipe waits for a writer.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise UnreadableFileError(error.strerror or str(error)) from None
    except ValueError as error:  # a NUL in the name
        raise UnreadableFileError(str(error)) from None
    found = os.fstat(descriptor)
    if not stat.S_ISREG(found.st_mode):
        os.close(descriptor)
        what = "a directory" if stat.S_ISDIR(found.st_mode) else "a pipe or a device"
        raise UnreadableFileError(f"it is {what}, not a file")
    with os.fdopen(descriptor, "rb") as file:
        _check_size(found.st_size, most_bytes)
        yield file


def read_regular(path: str | os.PathLike[str], most_bytes: int = _MOST_BYTES) -> bytes:
    """Return the content of a :func:`regular_file` of at most ``most_bytes``; raises its errors."""
    with regular_file(path, most_bytes) as file:
        try:
            data = file.read(most_bytes + 1)
        except OSError as error:
            raise UnreadableFileError(error.strerror or str(error)) from None
    # A file of /proc says that it is empty.
    _check_size(len(data), most_bytes)
    return data


def _check_size(found: int, most_bytes: int) -> None:
    if found > most_bytes:
        kilobytes = most_bytes // 1024
        most = f"{kilobytes} kB" if kilobytes < 1024 else f"{kilobytes // 1024} MB"
        raise UnreadableFileError(f"it has more than {most}")


def check_writable(path: str | os.PathLike[str]) -> None:
    """Raise CardboxError if :func:`atomic_path` cannot write ``path``, before long computations."""
    if is_written_in_place(path):
        return
    try:
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):
            os.stat(path)  # its name may be too long
    except OSError as error:
        raise _refused(Path(path), error) from None
    with claimed_name(resolved(path), is_folder=False):
        pass


def is_written_in_place(path: str | os.PathLike[str]) -> bool:
    """Return whether ``path`` cannot be replaced, as a pipe; CardboxError if a disk or a socket."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    except ValueError as error:  # a NUL in the name
        raise CardboxError(f"cannot write {quoted(os.fspath(path))}: {error}") from None
    if stat.S_ISBLK(mode) or stat.S_ISSOCK(mode):
        what = "a disk" if stat.S_ISBLK(mode) else "a socket"
        raise CardboxError(f"cannot write {os.fspath(path)}: it is {what}; give the name of a file")
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode) or _descriptor(path) is not None


def _descriptor(path: str | os.PathLike[str]) -> int | None:
    """Return the number of this process's open file that ``path`` names, such as /dev/stdout."""
    names = r"/dev/std(out|err)|/(?:dev|proc/self)/fd/(\d+)"
    found = re.fullmatch(names, os.path.abspath(path))
    if found is None:
        return None
    return int(found[2]) if found[2] else ("out", "err").index(found[1]) + 1


@contextmanager
def _copied_to(target: Path) -> Iterator[Path]:
    """Yield a path in a temporary folder, and copy the file to ``target`` at the end."""
    with tempfile.TemporaryDirectory(prefix="cardbox-") as folder:
        temporary = Path(folder) / f"output{target.suffix}"
        temporary.touch()
        yield temporary
        sys.stdout.flush()
        try:
            with temporary.open("rb") as source, os.fdopen(_open(target), "wb") as sink:
                shutil.copyfileobj(source, sink)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise _refused(target, error) from None


def _open(target: Path) -> int:
    """Open for writing without creating or truncating the file."""
    number = _descriptor(target)
    if number is not None:
        # A duplicate shares the offset, so that later output does not overwrite this one.
        return os.dup(number)
    return os.open(target, os.O_WRONLY | os.O_APPEND)


def _remove_leftovers(target: Path) -> None:
    stem, suffix = re.escape(target.stem[:_STEM_LENGTH]), re.escape(target.suffix)
    pattern = re.compile(rf"\.{stem}{re.escape(_MARK)}[0-9a-f]{{16}}{suffix}")
    with contextlib.suppress(OSError), os.scandir(target.parent) as entries:
        for entry in entries:
            if not pattern.fullmatch(entry.name) or entry.is_symlink():
                continue
            if entry.stat(follow_symlinks=False).st_uid != os.geteuid():
                continue
            descriptor = os.open(entry.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                if _lock(descriptor):
                    _remove(Path(entry.path))
            finally:
                os.close(descriptor)


def _lock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:  # it is locked already, or the file system has no locks
        return False
    return True


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _refused(target: Path, error: OSError) -> CardboxError:
    return CardboxError(
        f"cannot write {target}: {error.strerror}; choose a folder that exists and is writable"
    )


class _WithDecimalCommas(csv.DictReader):  # type: ignore[type-arg]
    def __next__(self) -> dict[str | Any, str | Any]:
        cells = super().__next__().items()
        return {
            name: cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(str(cell)) else cell
            for name, cell in cells
        }


@contextmanager
def table_rows(path: Path, most_bytes: int) -> Iterator[csv.DictReader[str]]:
    """Open a CSV table in UTF-8 of at most ``most_bytes``, and close it on exit.

    Where cells have semicolons or tabs between them, as spreadsheets write them in countries with
    decimal commas, 0,5 is read as 0.5. Raises UnreadableFileError, UnicodeDecodeError or csv.Error.
    """
    # Spreadsheets begin a file with a byte order mark.
    with (
        regular_file(path, most_bytes) as data,
        io.TextIOWrapper(data, newline="", encoding="utf-8-sig") as file,
    ):
        head = file.readline(_LONGEST_HEAD)
        file.seek(0)
        delimiter = max(",;\t", key=head.count)
        kind = csv.DictReader if delimiter == "," else _WithDecimalCommas
        yield kind(file, delimiter=delimiter)


def write_table(path: Path, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write a CSV file atomically; raise CardboxError if the file cannot be written."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(header)
        table.writerows(rows)


def body_beside(table: Path) -> Path:
    """Return the file beside a table of results with the body that was tracked."""
    return table.with_name(f"{table.stem}.body.yaml")


def scene_beside(table: Path) -> Path:
    """Return the file beside a table of results with its scene."""
    return table.with_name(f"{table.stem}.scene.yaml")


def body_of_person(body: Path, number: int) -> Path:
    """Return the file of the body of one of several people; ``body`` is that of the first."""
    return of_person(body, number, ".body.yaml")


def of_person(path: Path, number: int, suffix: str) -> Path:
    """Return the file of one of several people; ``path`` with this suffix is that of the first."""
    if number == 1:
        return path
    return path.with_name(f"{path.name.removesuffix(suffix)}.person_{number}{suffix}")
