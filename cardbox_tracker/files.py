"""Write a result so that a reader finds the whole of it or none."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cardbox_tracker.errors import CardboxError


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` with the same suffix; rename it when all went well.

    Raises:
        CardboxError: the folder of ``path`` cannot be written, or ``path`` is a folder itself.
    """
    target = Path(path)
    if target.is_dir():
        raise CardboxError(f"cannot write {target}: it is a folder; give the name of a file")
    temporary = target.with_name(f".{target.stem}.{os.getpid()}{target.suffix}")
    try:
        temporary.touch()
    except OSError as error:
        raise CardboxError(
            f"cannot write {target}: {error.strerror}; choose a folder that exists and is writable"
        ) from None
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
