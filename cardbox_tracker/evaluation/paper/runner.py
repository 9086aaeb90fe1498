"""Run many independent tasks on all cores, so that an interrupted evaluation can be resumed.

A task is a function and its arguments; its result is a dictionary of arrays. Each finished result
is a file in the folder ``parts`` of the output, written atomically, under a name that depends on
the function, its arguments and the sources it depends on. A task is therefore done once, however
often the evaluation is interrupted, and results of another version are never reused.
"""

from __future__ import annotations

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

import cardbox_tracker
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import atomic_path

_SOURCES = (
    "body",
    "vision",
    "estimation",
    "simulation",
    "recordings",
    "evaluation/truth.py",
    *(f"evaluation/paper/{name}.py" for name in ("sessions", "tracking", "models", "measuring")),
)

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Task:
    """One piece of work.

    Attributes:
        name: for the file's name; letters, digits, dots and dashes.
        function: of a module, so that another process finds it; takes the folder of the parts and
            the arguments, returns arrays.
        arguments: frozen dataclasses, numbers, strings and tuples, whose ``repr`` is complete.
        effort: expected time in any unit, for the progress bar.
    """

    name: str
    function: Callable[..., Arrays]
    arguments: tuple[Any, ...]
    effort: float = 1.0


class Parts:
    """The folder of finished results."""

    def __init__(self, folder: Path) -> None:
        """Make the folder.

        Raises:
            CardboxError: it cannot be made or written.
        """
        self.folder = folder
        self._version = source_digest()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CardboxError(
                f"cannot make the folder {folder}: {error.strerror}; "
                "give --output a folder that can be written"
            ) from None
        # Say at once, and not after the first result, that nothing can be written.
        with atomic_path(folder / "writable"):
            pass
        (folder / "writable").unlink(missing_ok=True)

    def path(self, task: Task) -> Path:
        """Return where the result of ``task`` is, or will be."""
        text = repr((self._version, task.function.__qualname__, task.arguments))
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        return self.folder / f"{task.name}-{digest}.npz"

    def load(self, task: Task) -> Arrays:
        """Return the result of a finished task."""
        with self.path(task).open("rb") as file, np.load(file) as arrays:
            return {name: arrays[name] for name in arrays}

    def seconds(self, task: Task) -> float:
        """Return how long a finished task took."""
        with self.path(task).open("rb") as file, np.load(file) as arrays:
            return float(arrays["seconds"])

    def is_done(self, task: Task) -> bool:
        """Return whether the result of ``task`` is there and whole."""
        try:
            self.seconds(task)
        except (OSError, ValueError, KeyError, EOFError, BadZipFile):
            return False
        return True

    def run(
        self, tasks: Sequence[Task], jobs: int, progress: Callable[[float], None] | None = None
    ) -> None:
        """Do all ``tasks`` that are not done yet, in ``jobs`` processes; 1 stays in this one.

        Args:
            tasks: the same task may be among them more than once.
            jobs: number of processes.
            progress: called with the finished fraction of what was to be done.

        Raises:
            CardboxError: a task fails, or a process was killed.
        """
        todo = {
            path: task for task in tasks if not self.is_done(task) for path in [self.path(task)]
        }
        # The longest first, so that no core is still busy with one when the others are done.
        order = sorted(todo.items(), key=lambda item: -item[1].effort)
        total = sum(task.effort for task in todo.values()) or 1.0
        finished = 0.0

        def advance(effort: float) -> None:
            nonlocal finished
            finished += effort
            if progress is not None:
                progress(finished / total)

        if jobs == 1 or len(order) < 2:
            for path, task in order:
                _perform(path, task)
                advance(task.effort)
            return
        # A forked child of a process with threads may hang; a new interpreter does not.
        pool = ProcessPoolExecutor(min(jobs, len(order)), get_context("spawn"))
        try:
            with _ignored_interrupts():
                efforts = {pool.submit(_perform, path, task): task.effort for path, task in order}
            for future in as_completed(efforts):
                future.result()
                advance(efforts[future])
        except BrokenProcessPool:
            raise CardboxError(
                "a process of the evaluation was ended from outside, as happens when memory runs "
                "out; the same command goes on where it stopped, with --jobs 1 in a single process"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _perform(path: Path, task: Task) -> None:
    start = time.perf_counter()
    arrays = task.function(path.parent, *task.arguments)
    seconds = time.perf_counter() - start
    with atomic_path(path) as temporary:
        stored: dict[str, Any] = {"seconds": np.array(seconds), **arrays}
        np.savez_compressed(temporary, **stored)


@contextmanager
def _ignored_interrupts() -> Iterator[None]:
    """Processes started in this context ignore Ctrl-C and finish their task.

    Only the parent reacts to Ctrl-C, after the context.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def default_jobs() -> int:
    """Return the number of cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def source_digest() -> str:
    """Return a digest of the sources that results depend on: not those of reports and plots."""
    root = Path(cardbox_tracker.__file__).parent
    digest = hashlib.sha256()
    for path in result_sources(root):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def result_sources(root: Path) -> list[Path]:
    """Return the source files below ``root`` that results depend on.

    Raises:
        FileNotFoundError: a listed folder or file does not exist; it was moved.
    """
    found = []
    for place in _SOURCES:
        path = root / place
        files = [path] if path.suffix else sorted(path.rglob("*.py"))
        if not files or not files[0].is_file():
            raise FileNotFoundError(f"{path} has no source file; was it moved?")
        found += files
    return found
