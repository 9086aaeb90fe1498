"""Run independent calls in several processes and cache their results with joblib."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from joblib import Memory, Parallel, delayed

import cardbox_tracker
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import check_writable
from cardbox_tracker.common.progress import progress_bar

Progress = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@dataclass(frozen=True)
class Call:
    """A function that other processes can import, and its arguments; hashable."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]


class Done(NamedTuple):
    """The result of a call and the processor time it took, seconds."""

    result: Any
    seconds: float


class Runner:
    """Runs calls; an interrupted evaluation resumes from the results in its folder."""

    def __init__(self, folder: Path, jobs: int, progress: Progress = progress_bar) -> None:
        """Make the folder of results.

        Args:
            folder: folder of the cache, which holds results of the present sources only.
            jobs: number of processes; 1 stays in this one.
            progress: makes a progress bar.

        Raises:
            CardboxError: the folder cannot be made or written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CardboxError(
                f"cannot make the folder {folder}: {error.strerror}; "
                "give --output a folder that can be written"
            ) from None
        check_writable(folder / "cache")
        self._memory = Memory(folder / source_digest(), compress=True, verbose=0)
        self._jobs, self._progress = jobs, progress

    def run(self, text: str, calls: Iterable[Call]) -> dict[Call, Done]:
        """Return the results of all calls; equal calls run once.

        Args:
            text: name of the progress bar.
            calls: in any order.
        """
        distinct = list(dict.fromkeys(calls))
        perform = delayed(self._memory.cache(_perform))
        # Memory maps would change the hash of arguments between processes.
        parallel = Parallel(self._jobs, return_as="generator", batch_size=1, max_nbytes=None)
        done = {}
        with self._progress(text) as show:
            results = parallel(perform(call.function, call.arguments) for call in distinct)
            for call, result in zip(distinct, results, strict=True):
                done[call] = Done(*result)
                show(len(done) / len(distinct))
        return done


def _perform(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[Any, float]:
    start = time.process_time()
    result = function(*arguments)
    return result, time.process_time() - start


def source_digest() -> str:
    """Return a digest of all sources but those of the tables and figures."""
    digest = hashlib.sha256()
    for root in (Path(cardbox_tracker.__file__).parent, Path(__file__).parent):
        for path in sorted(root.rglob("*.py")):
            if path.name not in ("plots.py", "report.py", "sequences.py"):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
