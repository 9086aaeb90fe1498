"""What rclpy's own executor does, this one does too: messages, services, timers, events, ends."""

from __future__ import annotations

import ast
import gc
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")

from rclpy.callback_groups import ReentrantCallbackGroup  # noqa: E402
from rclpy.event_handler import SubscriptionEventCallbacks  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.task import Future  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from cardbox_tracker.ros.runtime import static_executor, wait_set  # noqa: E402
from cardbox_tracker.ros.runtime.node import spin  # noqa: E402
from cardbox_tracker.ros.runtime.static_executor import (  # noqa: E402
    StaticExecutor,
    make_executor,
)
from cardbox_tracker.ros.runtime.wait_set import RELIED_ON, UnsuitableRclpyError  # noqa: E402

LIMIT_S = 30.0
QOS = QoSProfile(depth=100)


class Served:
    """A node that a :class:`StaticExecutor` serves in a thread, and one that talks to it."""

    def __init__(self, make_node: Callable[..., Any]) -> None:
        self.node = make_node(name="served")
        self.other = make_node(name="other")
        self.errors: list[BaseException] = []
        self._executor = make_executor(self.node.context)
        self._executor.add_node(self.node)
        self._others = SingleThreadedExecutor(context=self.node.context)
        self._others.add_node(self.other)
        self._thread = threading.Thread(target=self._spin)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except Exception as error:
            self.errors.append(error)

    @property
    def executor(self) -> Any:
        return self._executor

    def begin(self) -> None:
        self._thread.start()

    def until(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end, "not in time"
            self._others.spin_once(timeout_sec=0.01)

    def publisher(self, topic: str) -> Any:
        publisher = self.other.create_publisher(String, topic, QOS)
        self.until(publisher.get_subscription_count)
        return publisher

    def call(self, name: str) -> Any:
        client = self.other.create_client(Trigger, name)
        self.until(client.service_is_ready)
        answer = client.call_async(Trigger.Request())
        self.until(answer.done)
        return answer.result()

    def end(self) -> None:
        self._executor.shutdown()
        if self._thread.is_alive():
            self._thread.join(LIMIT_S)
        self._others.shutdown()
        assert not self._thread.is_alive(), "the executor did not end"


class Without:
    """Stands for an object that lacks one attribute, or whose attribute lacks one."""

    def __init__(self, original: Any, path: list[str]) -> None:
        self._original = original
        self._path = path

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._original, name)
        if name != self._path[0]:
            return value
        if len(self._path) == 1:
            raise AttributeError(name)
        return Without(value, self._path[1:])

    def __call__(self, *arguments: Any) -> Any:
        return self._original(*arguments)


def remove(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Hide a name of ``RELIED_ON`` from the module, not from rclpy itself."""
    root, *path = name.split(".")
    monkeypatch.setattr(wait_set, root, Without(getattr(wait_set, root), path))


def warnings_in(log: str) -> list[str]:
    return [line for line in log.splitlines() if "[cardbox_tracker]" in line]


@pytest.fixture
def served(make_node: Callable[..., Any]) -> Iterator[Served]:
    made = Served(make_node)
    yield made
    made.end()


def accept(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    return response


def test_every_message_arrives_in_its_order(served: Served) -> None:
    heard: list[str] = []
    served.node.create_subscription(String, "words", lambda word: heard.append(word.data), QOS)
    served.begin()
    publisher = served.publisher("words")
    sent = [str(i) for i in range(50)]
    for word in sent:
        publisher.publish(String(data=word))
    served.until(lambda: len(heard) == len(sent))
    assert heard == sent


def test_a_callback_may_ask_for_the_messages_circumstances_or_bytes(served: Served) -> None:
    heard: list[Any] = []

    def with_info(message: String, info: Any) -> None:
        heard.append((message.data, info["source_timestamp"] > 0))

    served.node.create_subscription(String, "words", with_info, QOS)
    served.node.create_subscription(String, "words", heard.append, QOS, raw=True)
    served.begin()
    publisher = served.publisher("words")
    served.until(lambda: publisher.get_subscription_count() == 2)
    publisher.publish(String(data="hello"))
    served.until(lambda: len(heard) == 2)
    assert ("hello", True) in heard
    assert any(isinstance(item, bytes) and b"hello" in item for item in heard)


def test_timers_and_services_are_served_between_messages(served: Served) -> None:
    ticks: list[None] = []
    heard: list[str] = []
    served.node.create_timer(0.02, lambda: ticks.append(None))
    served.node.create_service(Trigger, "do", accept)
    served.node.create_subscription(String, "words", lambda word: heard.append(word.data), QOS)
    served.begin()
    publisher = served.publisher("words")
    for i in range(5):
        publisher.publish(String(data="word"))
        assert served.call("do").success
        served.until(lambda i=i: len(ticks) > i)
    served.until(lambda: len(heard) == 5)


def test_a_coroutine_is_awaited_while_messages_go_on(served: Served) -> None:
    heard: list[str] = []
    asked = threading.Event()
    done: Future = Future()

    async def patient(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        asked.set()
        response.message = await done
        return response

    group = ReentrantCallbackGroup()
    served.node.create_service(Trigger, "wait", patient, callback_group=group)
    served.node.create_subscription(String, "words", lambda word: heard.append(word.data), QOS)
    served.begin()
    publisher = served.publisher("words")
    client = served.other.create_client(Trigger, "wait")
    served.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    served.until(asked.is_set)
    publisher.publish(String(data="meanwhile"))
    served.until(lambda: heard)
    assert not answer.done()
    done.set_result("at last")
    served.node.executor.wake()
    served.until(answer.done)
    assert answer.result().message == "at last"
    publisher.publish(String(data="afterwards"))
    served.until(lambda: len(heard) == 2)


def test_a_subscription_may_be_a_coroutine(served: Served) -> None:
    heard: list[str] = []

    async def listen(word: String) -> None:
        heard.append(word.data)

    served.node.create_subscription(String, "words", listen, QOS)
    served.begin()
    served.publisher("words").publish(String(data="hello"))
    served.until(lambda: heard)
    assert heard == ["hello"]


def test_what_a_callback_creates_or_destroys_is_noticed(served: Served) -> None:
    heard: list[str] = []
    made: list[Any] = []

    def once(word: String) -> None:
        heard.append(word.data)
        served.node.destroy_subscription(first)
        made.append(
            served.node.create_subscription(String, "more", lambda w: heard.append(w.data), QOS)
        )

    first = served.node.create_subscription(String, "words", once, QOS)
    served.begin()
    words = served.publisher("words")
    words.publish(String(data="one"))
    served.until(lambda: made)
    served.until(lambda: words.get_subscription_count() == 0)
    served.publisher("more").publish(String(data="two"))
    served.until(lambda: len(heard) == 2)
    assert heard == ["one", "two"]


def test_an_event_of_quality_of_service_is_not_lost(served: Served) -> None:
    events: list[Any] = []
    served.node.create_subscription(
        String,
        "words",
        lambda _: None,
        QOS,
        event_callbacks=SubscriptionEventCallbacks(incompatible_qos=events.append),
    )
    served.begin()
    weak = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    served.other.create_publisher(String, "words", weak)
    served.until(lambda: events)


def test_what_a_callback_raises_ends_the_spinning(served: Served) -> None:
    def fail(_: String) -> None:
        raise RuntimeError("as told")

    served.node.create_subscription(String, "words", fail, QOS)
    served.begin()
    served.publisher("words").publish(String(data="now"))
    served.until(lambda: served.errors)
    assert str(served.errors[0]) == "as told"


def test_it_ends_with_ros(served: Served) -> None:
    served.node.create_subscription(String, "words", lambda _: None, QOS)
    served.begin()
    time.sleep(0.1)
    served.node.context.shutdown()
    end = time.monotonic() + LIMIT_S
    while not served.errors:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert isinstance(served.errors[0], ExternalShutdownException)


def test_a_coroutine_goes_on_when_nobody_wakes_the_executor(served: Served) -> None:
    done: Future = Future()

    async def patient(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        await done
        return response

    group = ReentrantCallbackGroup()
    served.node.create_service(Trigger, "wait", patient, callback_group=group)
    served.begin()
    client = served.other.create_client(Trigger, "wait")
    served.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    end = time.monotonic() + 0.3
    served.until(lambda: time.monotonic() > end)
    done.set_result(None)
    served.until(answer.done)


def test_a_coroutine_may_wait_for_what_a_message_brings(served: Served) -> None:
    arrived: Future = Future()

    async def patient(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = await arrived
        return response

    group = ReentrantCallbackGroup()
    served.node.create_service(Trigger, "wait", patient, callback_group=group)
    served.node.create_subscription(
        String, "words", lambda word: arrived.set_result(word.data), QOS, callback_group=group
    )
    served.begin()
    publisher = served.publisher("words")
    client = served.other.create_client(Trigger, "wait")
    served.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    end = time.monotonic() + 0.1
    served.until(lambda: time.monotonic() > end)
    publisher.publish(String(data="hello"))
    served.until(answer.done)
    assert answer.result().message == "hello"


def test_what_a_coroutine_raises_after_waiting_ends_the_spinning(served: Served) -> None:
    done: Future = Future()

    async def fail() -> None:
        await done
        raise RuntimeError("as told")

    served.executor.create_task(fail)
    served.begin()
    time.sleep(0.1)
    done.set_result(None)
    served.until(lambda: served.errors)
    assert str(served.errors[0]) == "as told"


def test_tasks_are_run_at_once_and_a_cancelled_one_is_forgotten(served: Served) -> None:
    ran: list[str] = []
    never: Future = Future()

    async def wait_for_ever() -> None:
        ran.append("waiting")
        await never

    served.begin()
    waiting = served.executor.create_task(wait_for_ever)
    served.until(lambda: ran)
    waiting.cancel()
    served.executor.create_task(ran.append, "after")
    served.until(lambda: len(ran) == 2)
    assert not served.errors


def test_a_guard_condition_of_a_node_is_served(served: Served) -> None:
    seen: list[None] = []
    guard = served.node.create_guard_condition(lambda: seen.append(None))
    served.begin()
    for i in range(3):
        guard.trigger()
        served.until(lambda i=i: len(seen) == i + 1)


def test_a_node_may_be_added_and_removed_while_it_spins(
    served: Served, make_node: Callable[..., Any]
) -> None:
    heard: list[str] = []
    served.begin()
    time.sleep(0.1)
    late = make_node(name="late")
    late.create_subscription(String, "words", lambda word: heard.append(word.data), QOS)
    served.executor.add_node(late)
    publisher = served.publisher("words")
    publisher.publish(String(data="one"))
    served.until(lambda: heard)
    served.executor.remove_node(late)
    time.sleep(0.2)
    publisher.publish(String(data="two"))
    time.sleep(0.2)
    assert heard == ["one"]


def test_an_interrupted_construction_leaves_no_traceback(
    make_node: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[Any] = []

    def interrupt(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    context = make_node().context
    monkeypatch.setattr(sys, "unraisablehook", left.append)
    for place in ("GuardCondition", "SignalHandlerGuardCondition"):
        with monkeypatch.context() as patch:
            patch.setattr(f"rclpy.executors.{place}", interrupt)
            with pytest.raises(KeyboardInterrupt):
                StaticExecutor(context=context)
            gc.collect()
    assert not left


def test_ctrl_c_while_it_is_made_leaves_no_traceback(
    make_node: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[Any] = []
    original = rclpy.executors.SignalHandlerGuardCondition

    def interrupted(*arguments: Any) -> Any:
        made = original(*arguments)
        signal.raise_signal(signal.SIGINT)
        return made

    context = make_node().context
    monkeypatch.setattr(sys, "unraisablehook", left.append)
    with monkeypatch.context() as patch:
        patch.setattr("rclpy.executors.SignalHandlerGuardCondition", interrupted)
        # Other libraries' callbacks during a collection would swallow the interrupt.
        gc.disable()
        try:
            with pytest.raises(KeyboardInterrupt):
                make_executor(context)
        finally:
            gc.enable()
        gc.collect()
    assert not left


def test_it_may_outlive_its_context_without_a_traceback(
    make_node: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    left: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", left.append)
    executor = StaticExecutor(context=make_node().context)
    executor.shutdown()
    executor.shutdown()
    executor.wake()
    executor.context.shutdown()
    del executor
    gc.collect()
    assert not left


@pytest.mark.parametrize("name", RELIED_ON)
def test_what_rclpy_lacks_is_named_once_and_its_own_executor_serves(
    name: str,
    make_node: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    remove(monkeypatch, name)
    served = Served(make_node)
    try:
        assert type(served.executor) is SingleThreadedExecutor
        with pytest.raises(UnsuitableRclpyError):
            StaticExecutor(context=served.node.context)
        heard: list[str] = []
        served.node.create_subscription(String, "words", lambda word: heard.append(word.data), QOS)
        served.begin()
        served.publisher("words").publish(String(data="hello"))
        served.until(lambda: heard)
    finally:
        served.end()
    (warning,) = warnings_in(capfd.readouterr().err)
    assert "[WARN]" in warning
    assert name in warning


def test_a_node_spins_where_rclpy_lacks_something(
    make_node: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    remove(monkeypatch, RELIED_ON[-1])
    node = make_node()

    def hear(word: String) -> None:
        raise RuntimeError(f"heard {word.data}")

    node.create_subscription(String, "words", hear, QOS)
    publisher = node.create_publisher(String, "words", QOS)
    node.create_timer(0.05, lambda: publisher.publish(String(data="hello")))
    with pytest.raises(RuntimeError, match="heard hello"):
        spin(node)
    assert len(warnings_in(capfd.readouterr().err)) == 1


def test_a_wait_set_of_another_kind_is_noticed(
    make_node: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def changed(*_: Any) -> Any:
        raise TypeError("incompatible constructor arguments")

    monkeypatch.setattr(wait_set, "_wait_set", changed)
    assert type(make_executor(make_node().context)) is SingleThreadedExecutor
    (warning,) = warnings_in(capfd.readouterr().err)
    assert "incompatible constructor arguments" in warning


def test_nothing_is_warned_of_with_this_rclpy(
    served: Served, capfd: pytest.CaptureFixture[str]
) -> None:
    assert isinstance(served.executor, StaticExecutor)
    assert not warnings_in(capfd.readouterr().err)


@pytest.mark.parametrize("module", [static_executor, wait_set])
def test_no_private_name_of_rclpy_is_used(module: ModuleType) -> None:
    tree = list(ast.walk(ast.parse(Path(str(module.__file__)).read_text())))
    own = {node.name for node in tree if isinstance(node, ast.FunctionDef)} | {
        node.attr
        for node in tree
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    }
    used = {node.attr for node in tree if isinstance(node, ast.Attribute)}
    assert {name for name in used if name.startswith("_")} <= own | {"__del__"}
