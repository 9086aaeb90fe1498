"""Independent calls in several processes of one thread each, here or on a Dask cluster."""

from __future__ import annotations

import asyncio
import ctypes
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from multiprocessing import resource_tracker
from typing import TypeVar
from warnings import catch_warnings, simplefilter

from cardbox_tracker.common import interrupts
from cardbox_tracker.common.errors import CardboxError, cut
from cardbox_tracker.common.extensions import optional

A = TypeVar("A")
R = TypeVar("R")

_CONNECT_S = 10.0
_ENDED = "a process ended unexpectedly, perhaps because the memory was full"
# PR_SET_PDEATHSIG of <linux/prctl.h>.
_DEATH_SIGNAL = 1
_TAKEN_UP_S = 0.05
"""Time in which loky's thread puts the first calls into the queue of the processes (s)."""


def _called(parent: int, function: Callable[[A], R], argument: A) -> R:
    _end_with(parent)
    return function(argument)


def _end_with(parent: int) -> None:
    if os.getpid() != parent and sys.platform.startswith("linux"):
        # The kernel ends this process with its parent, also if that is killed.
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)


def cores() -> int:
    """Return the number of cores that this process may use."""
    from joblib import cpu_count

    return int(cpu_count())


def shared_calls(
    function: Callable[[A], object], arguments: Sequence[A], jobs: int
) -> Iterator[float]:
    """Call a function for what it writes, with each argument, in this process and copies of it.

    Copies have all that this one has loaded. The ``jobs`` processes take up to 256 arguments in
    their order; after each call of this one, the fraction that has been taken is yielded. Leaving
    before the end, as by Ctrl-C, ends the copies. Raises CardboxError if one failed.
    """
    waiting, given = os.pipe()
    os.write(given, bytes(range(len(arguments))))
    os.close(given)
    parent, copies = os.getpid(), list[int]()
    try:
        # Copies never receive SIGINT.
        with interrupts.withheld():
            while len(copies) + 1 < min(jobs, len(arguments)):
                if copy := os.fork():
                    copies.append(copy)
                    continue
                code = 1
                try:
                    _end_with(parent)
                    while number := os.read(waiting, 1):
                        function(arguments[number[0]])
                    code = 0
                finally:
                    os._exit(code)
        while number := os.read(waiting, 1):
            function(arguments[number[0]])
            yield number[0] / len(arguments)
        while copies:
            _, code = os.waitpid(copies[-1], 0)
            copies.pop()
            if code:
                raise CardboxError(_ENDED)
    finally:
        os.close(waiting)
        for copy in copies:
            os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)


@contextmanager
def results_of(
    function: Callable[[A], R], arguments: Sequence[A], jobs: int, scheduler: str | None = None
) -> Iterator[Iterator[R]]:
    """Context of an iterator over the results of calls, in the order in which they finish.

    Other processes import the module of ``function`` and begin in the order of ``arguments``:
    ``jobs`` of them, or this one with 1 job, or the workers of the Dask cluster of a ``scheduler``.
    Leaving the context before the end, as by Ctrl-C, ends all at once. Raises CardboxError if a
    process ended unexpectedly, or there is no cluster of workers with one thread each.
    """
    from joblib import Parallel, delayed, parallel_config

    # Python's tracker of resources unblocks SIGINT when it starts, so it starts before.
    resource_tracker.ensure_running()
    with ExitStack() as stack:
        call = function
        if scheduler is None:
            call = partial(_called, os.getpid(), function)
            # numba, BLAS and OpenMP read their number of threads when a process begins.
            stack.enter_context(parallel_config("loky", inner_max_num_threads=1))
        else:
            stack.enter_context(_cluster(scheduler))
            stack.enter_context(parallel_config("dask"))
        # loky's thread fails with a KeyError if it is ended while calls wait that it has not yet
        # put into the queue of the processes: no more are given than the queue holds.
        parallel = Parallel(
            jobs if scheduler is None else -1,
            return_as="generator_unordered",
            batch_size=1,
            pre_dispatch="2*n_jobs",
            max_nbytes=None,
        )
        stack.enter_context(_told())
        # A process may already end while others still get their calls.
        with interrupts.withheld():
            results = parallel(delayed(call)(argument) for argument in arguments)
            time.sleep(_TAKEN_UP_S)
        try:
            yield results
        finally:
            with catch_warnings():
                # joblib advises to submit fewer calls when it is left before the end.
                simplefilter("ignore", UserWarning)
                results.close()


@contextmanager
def _cluster(scheduler: str) -> Iterator[None]:
    dask = optional("distributed", "--scheduler needs Dask", "cluster")

    async def greet() -> None:
        # The client waits for longer if a server is silent.
        comm = await asyncio.wait_for(dask.comm.connect(scheduler, timeout=_CONNECT_S), _CONNECT_S)
        await comm.close()

    # Dask logs what else a server answers.
    logging.disable()
    try:
        asyncio.run(greet())
        client = dask.Client(scheduler, timeout=_CONNECT_S, set_as_default=True)
    except Exception as error:
        # What other servers answer raises errors of any type.
        raise CardboxError(
            f"no Dask scheduler answers at {scheduler}: {cut(str(error)) or type(error).__name__}; "
            "give an address such as tcp://HOST:8786, which 'dask scheduler' prints"
        ) from None
    finally:
        logging.disable(logging.NOTSET)
    with client:
        threads = client.nthreads()
        if not threads or max(threads.values()) > 1:
            raise CardboxError(
                f"the cluster at {scheduler} has {len(threads)} workers with "
                f"{sum(threads.values())} threads; expected workers with one thread each, from "
                f"'dask worker {scheduler} --nworkers N --nthreads 1'"
            )
        yield


@contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except Exception as error:
        # The second one is Dask's, which may not be installed.
        if not isinstance(error, BrokenExecutor) and type(error).__name__ != "KilledWorker":
            raise
        raise CardboxError(f"{_ENDED}; give a smaller --jobs") from None
