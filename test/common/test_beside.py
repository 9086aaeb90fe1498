"""Work beside the caller: order, errors and ends are those of calls one by one."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.common.beside import done_beside, results_ahead


@given(st.lists(st.integers(), max_size=12))
def test_results_are_those_of_calls_one_by_one(items: list[int]) -> None:
    assert list(results_ahead(str, items)) == [str(item) for item in items]
    done = list[int]()
    with done_beside(done.append) as submit:
        for item in items:
            submit(item)
    assert done == items


def test_the_next_results_are_made_while_the_caller_works() -> None:
    made = threading.Event()

    def call(item: int) -> int:
        if item == 1:
            made.set()
        return item

    results = results_ahead(call, count())
    assert next(results) == 0
    assert made.wait(5.0)
    results.close()


def test_few_items_are_taken_ahead_and_the_thread_ends_with_the_iterator() -> None:
    taken = list[int]()

    def items() -> Iterator[int]:
        for item in count():
            taken.append(item)
            yield item

    before = threading.active_count()
    results = results_ahead(str, items())
    assert next(results) == "0"
    assert len(taken) <= 4
    results.close()
    assert threading.active_count() == before


def test_an_interrupt_does_not_wait_for_a_call_that_hangs() -> None:
    go_on, ended = threading.Event(), threading.Event()

    def call(_: int) -> None:
        if not go_on.is_set():
            go_on.wait(20.0)
            ended.set()

    def items() -> Iterator[int]:
        yield 0
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        next(results_ahead(call, items()))
    assert not ended.is_set()
    go_on.set()


def test_nothing_is_done_after_an_error() -> None:
    begun = list[int]()

    def call(item: int) -> None:
        begun.append(item)
        if item == 1:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError), done_beside(call) as submit:
        for item in range(4):
            submit(item)
        time.sleep(0.1)  # An encoder of a film that could not be written crashed meanwhile.
    assert begun == [0, 1]


def test_an_error_comes_in_place_of_its_result() -> None:
    results = results_ahead(lambda item: 1 // item, [1, 0, 1])
    assert next(results) == 1
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_the_context_raises_the_error_of_a_call() -> None:
    before = threading.active_count()
    with pytest.raises(ZeroDivisionError), done_beside(lambda item: 1 // item) as submit:
        submit(0)
    assert threading.active_count() == before


def test_after_an_error_calls_that_have_not_begun_are_left_out() -> None:
    begun, go = list[int](), threading.Event()

    def call(item: int) -> None:
        begun.append(item)
        go.wait(5.0)

    with pytest.raises(KeyboardInterrupt), done_beside(call) as submit:
        submit(0)
        submit(1)
        while not begun:
            time.sleep(0.001)
        threading.Timer(0.05, go.set).start()
        raise KeyboardInterrupt
    assert begun == [0]
