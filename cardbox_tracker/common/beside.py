"""Work in a thread beside the one that needs it; libraries of images and networks compute there."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from cardbox_tracker.common import interrupts

A = TypeVar("A")
R = TypeVar("R")

_MOST = 3
"""Calls that wait for the other thread, since each holds an image."""


def results_ahead(call: Callable[[A], R], items: Iterable[A]) -> Iterator[R]:
    """Yield the results of calls in order; another thread makes the next ones meanwhile.

    An error of a call is raised in place of its result. The thread ends with the iterator; the
    caller's thread advances ``items`` a few ahead.
    """
    with _worker() as pool:
        waiting = deque[Future[R]]()
        for item in items:
            waiting.append(pool.submit(call, item))
            if len(waiting) > _MOST:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


@contextmanager
def done_beside(call: Callable[..., object]) -> Iterator[Callable[..., None]]:
    """Context of a function that lets another thread call ``call``, in order, with its arguments.

    It waits while several calls are not done. It, or the end of the context, raises the error of a
    call; after any error, calls that have not begun are left out.
    """
    failed = False

    def unless_failed(*given: object) -> None:
        nonlocal failed
        if failed:
            return
        try:
            call(*given)
        except BaseException:
            failed = True
            raise

    with _worker() as pool:
        waiting = deque[Future[object]]()

        def submit(*given: object) -> None:
            waiting.append(pool.submit(unless_failed, *given))
            while len(waiting) > _MOST:
                waiting.popleft().result()

        yield submit
        for one in waiting:
            one.result()


@contextmanager
def _worker() -> Iterator[ThreadPoolExecutor]:
    pool, is_interrupted = ThreadPoolExecutor(1), False
    try:
        yield pool
    except KeyboardInterrupt:
        is_interrupted = True
        raise
    finally:
        # A call of foreign code may never end.
        pool.shutdown(wait=not (is_interrupted or interrupts.received()), cancel_futures=True)
