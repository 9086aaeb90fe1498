"""Nodes of one process get the message object itself; other nodes get it over DDS."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode, IntraProcess


@pytest.fixture
def make(make_node: Callable[..., Any]) -> Iterator[Callable[..., CardboxNode]]:
    """Return a function that makes nodes of one process."""
    context = make_node(name="outside").context
    nodes: list[CardboxNode] = []

    def create(name: str, intra_process: IntraProcess | None) -> CardboxNode:
        node = CardboxNode(name, intra_process, context=context, enable_rosout=False)
        nodes.append(node)
        return node

    yield create
    for node in nodes:
        node.destroy_node()


def test_takers_get_the_message_itself_at_once_and_in_order(make: Callable[..., Any]) -> None:
    intra_process, taken = IntraProcess(), []
    publisher = make("giver", intra_process).advertise_inside(String, "words", qos.RESULT)
    for name in ("first", "second"):
        make(name, intra_process).subscribe(
            String, "words", lambda word, _, name=name: taken.append((name, word)), qos.RESULT
        )
    word = String(data="hello")
    publisher.publish(word)
    assert [name for name, _ in taken] == ["first", "second"]
    assert all(item is word for _, item in taken)


def test_a_taker_learns_when_it_was_handed_over(make: Callable[..., Any]) -> None:
    intra_process, sent_ns = IntraProcess(), []
    publisher = make("giver", intra_process).advertise_inside(String, "words", qos.RESULT)
    make("taker", intra_process).subscribe(
        String, "words", lambda _, sent: sent_ns.append(sent), qos.RESULT
    )
    before = time.time_ns()
    publisher.publish(String())
    assert before <= sent_ns[0] <= time.time_ns()


def test_an_error_of_one_taker_is_its_own(make: Callable[..., Any]) -> None:
    intra_process, taken = IntraProcess(), []
    publisher = make("giver", intra_process).advertise_inside(String, "words", qos.RESULT)
    failing = make("failing", intra_process)

    def fail(_: String, __: int) -> None:
        raise CardboxError("as told")

    failing.subscribe(String, "words", fail, qos.RESULT)
    make("taker", intra_process).subscribe(
        String, "words", lambda w, _: taken.append(w), qos.RESULT
    )
    publisher.publish(String(data="hello"))
    assert taken[0].data == "hello"
    assert failing.diagnostics.status().message == "as told"


@pytest.mark.parametrize("shared", [True, False])
def test_what_is_not_handed_over_goes_by_dds(make: Callable[..., Any], shared: bool) -> None:
    """Topics without intra-process subscription, and nodes without shared process."""
    intra_process = IntraProcess() if shared else None
    giver, taker = make("giver", intra_process), make("taker", intra_process)
    offer = giver.advertise if shared else giver.advertise_inside
    publisher = offer(String, "words", qos.RESULT)
    taken: list[str] = []
    taker.subscribe(String, "words", lambda word, _: taken.append(word.data), qos.RESULT)
    hear(taker, publisher, taken)


def test_other_processes_get_it_too(make: Callable[..., Any]) -> None:
    intra_process, inside, outside = IntraProcess(), [], []
    publisher = make("giver", intra_process).advertise_inside(String, "words", qos.RESULT)
    make("taker", intra_process).subscribe(
        String, "words", lambda w, _: inside.append(w), qos.RESULT
    )
    other = make("other", None)
    other.subscribe(String, "words", lambda word, _: outside.append(word.data), qos.RESULT)
    hear(other, publisher, outside)
    assert inside[-1].data == "hello"


def hear(node: Any, publisher: Any, taken: list[str]) -> None:
    """Publish until ``node`` got a message over DDS, which never happens within the call."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    end = time.monotonic() + 30
    while not taken:
        assert time.monotonic() < end
        publisher.publish(String(data="hello"))
        assert not taken
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert taken[0] == "hello"
