"""Independent calls in several processes of one thread each."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import TypeVar
from warnings import catch_warnings, simplefilter

from cardbox_tracker.common import interrupts
from cardbox_tracker.common.errors import CardboxError

A = TypeVar("A")
R = TypeVar("R")

# PR_SET_PDEATHSIG of <linux/prctl.h>.
_DEATH_SIGNAL = 1
_TAKEN_UP_S = 0.05
"""Time in which loky's thread puts the first calls into the queue of the processes (s)."""


def _called(parent: int, function: Callable[[A], R], argument: A) -> R:
    if os.getpid() != parent and sys.platform.startswith("linux"):
        # The kernel ends this process with its parent, also if that is killed.
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)
    return function(argument)


def cores() -> int:
    """Return the number of cores that this process may use."""
    from joblib import cpu_count

    return int(cpu_count())


@contextmanager
def results_of(
    function: Callable[[A], R], arguments: Sequence[A], jobs: int
) -> Iterator[Iterator[R]]:
    """Context of an iterator over the results of calls, in the order in which they finish.

    Leaving the context before the end, as by Ctrl-C, ends all processes at once.

    Args:
        function: function of a module that other processes can import.
        arguments: the argument of each call; calls begin in this order.
        jobs: number of processes; with 1, the calls are done in this process.

    Raises:
        CardboxError: a process ended unexpectedly; at the beginning, or from the iterator.
    """
    from joblib import Parallel, delayed, parallel_config

    # Python's tracker of resources unblocks SIGINT when it starts, so it starts before.
    resource_tracker.ensure_running()
    # numba, BLAS and OpenMP read their number of threads when a process begins.
    with parallel_config("loky", inner_max_num_threads=1):
        # loky's thread fails with a KeyError if it is ended while calls wait that it has not yet
        # put into the queue of the processes: no more are given than the queue holds.
        parallel = Parallel(
            jobs,
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch="2*n_jobs",
            max_nbytes=None,
        )
        # A process may already end while others still get their calls.
        with interrupts.withheld(), _told():
            call = delayed(_called)
            results = parallel(call(os.getpid(), function, argument) for argument in arguments)
            time.sleep(_TAKEN_UP_S)
    try:
        yield _checked(results)
    finally:
        with catch_warnings():
            # joblib advises to submit fewer calls when it is left before the end.
            simplefilter("ignore", UserWarning)
            results.close()


def _checked(results: Iterator[R]) -> Iterator[R]:
    with _told():
        yield from results


@contextmanager
def _told() -> Iterator[None]:
    """Context in which the unexpected end of a process is told in words."""
    try:
        yield
    except BrokenExecutor:
        raise CardboxError(
            "a process ended unexpectedly, perhaps because the memory was full; give a smaller "
            "--jobs"
        ) from None
