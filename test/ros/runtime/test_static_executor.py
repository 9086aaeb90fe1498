"""What rclpy's own executor does, this one does too: messages, services, timers, events, ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
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

from cardbox_tracker.ros.runtime.static_executor import StaticExecutor  # noqa: E402

LIMIT_S = 30.0
QOS = QoSProfile(depth=100)


class Served:
    """A node that a :class:`StaticExecutor` serves in a thread, and one that talks to it."""

    def __init__(self, make_node: Callable[..., Any]) -> None:
        self.node = make_node(name="served")
        self.other = make_node(name="other")
        self.errors: list[BaseException] = []
        self._executor = StaticExecutor(context=self.node.context)
        self._executor.add_node(self.node)
        self._others = SingleThreadedExecutor(context=self.node.context)
        self._others.add_node(self.other)
        self._thread = threading.Thread(target=self._spin)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except Exception as error:
            self.errors.append(error)

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
