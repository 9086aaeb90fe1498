"""Base class of the nodes: topics, services and diagnostics that no bad message can end."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from copy import copy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol, TypeVar

import rclpy
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.utilities import ok, remove_ros_args, try_shutdown
from sensor_msgs.msg import CameraInfo
from std_srvs.srv import Trigger

from cardbox_tracker.common import garbage, interrupts
from cardbox_tracker.common.errors import CardboxError, cut, quoted
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.diagnostics import NodeDiagnostics, every_second
from cardbox_tracker.ros.runtime.named_parameters import in_every_namespace
from cardbox_tracker.ros.runtime.publishers import TopicTypes

Subscriber = Callable[[Any, dict[str, Any]], None]
"""A callback that takes a message and rclpy's information about it."""


class IntraProcess:
    """The subscribers of this process by topic; one object for all its nodes."""

    def __init__(self) -> None:
        self._subscribers: dict[str, list[Subscriber]] = {}

    def advertise(self, publisher: Publisher) -> IntraProcessPublisher:
        """Pass the messages of ``publisher`` to subscribers of this process from now on."""
        return IntraProcessPublisher(
            publisher, self._subscribers.setdefault(publisher.topic_name, [])
        )

    def subscribe(self, topic: str, subscriber: Subscriber) -> bool:
        """Call ``subscriber`` with each message; return False if nobody here offers ``topic``."""
        subscribers = self._subscribers.get(topic)
        if subscribers is None:
            return False
        subscribers.append(subscriber)
        return True


class IntraProcessPublisher:
    """Publishes to the subscribers of this process in order, then to all others."""

    def __init__(self, publisher: Publisher, subscribers: list[Subscriber]) -> None:
        self._publisher = publisher
        self._subscribers = subscribers

    def get_subscription_count(self) -> int:
        """Return the number of subscribers in this process and in others."""
        return len(self._subscribers) + int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Call all subscribers of this process, which must not change ``message``."""
        for subscriber in self._subscribers:
            subscriber(message, {"source_timestamp": time.time_ns()})
        if self._publisher.get_subscription_count():
            self._publisher.publish(message)


Callback = Callable[[Any, int], None]
"""Callback that receives a message and its send time, ns since the epoch."""


class Closable(Protocol):
    """One or several nodes with resources to release."""

    def close(self) -> None:
        """Release it."""


N = TypeVar("N", bound=Closable)


class CardboxNode(Node):
    """A node with diagnostics of its state, its missing inputs and its errors."""

    def __init__(
        self, name: str, intra_process: IntraProcess | None = None, **options: Any
    ) -> None:
        """Create the node; nodes that share ``intra_process`` make their publishers first."""
        super().__init__(name, **options)
        self._intra_process = intra_process
        self.diagnostics = NodeDiagnostics(self)
        self._types = TopicTypes(self)
        self.diagnostics.remarks = self._types.remarks

    def resolve(self, topic: str) -> str:
        """Return the full name of ``topic``, or raise CardboxError if ROS does not allow it."""
        try:
            return self.resolve_topic_name(topic)
        except Exception as error:
            # The class of this error depends on the release of rclpy.
            raise CardboxError(
                f"ROS does not allow a topic named {quoted(topic)}: {cut(str(error))}; give it "
                "another name, or play others of the recording with --topics"
            ) from None

    def advertise(self, kind: Any, topic: str, profile: QoSProfile) -> Publisher:
        """Create a publisher whose QoS can be overridden and whose mismatches are reported."""
        self._types.add(self.resolve(topic), kind)
        return self.create_publisher(
            kind,
            topic,
            copy(profile),  # which an override changes
            event_callbacks=qos.publisher_events(self.resolve(topic), self.diagnostics.warn),
            qos_overriding_options=qos.overridable(profile),
        )

    def advertise_inside(
        self, kind: Any, topic: str, profile: QoSProfile
    ) -> Publisher | IntraProcessPublisher:
        """Create a publisher like :meth:`advertise` that bypasses DDS inside this process."""
        publisher = self.advertise(kind, topic, profile)
        if self._intra_process is None:
            return publisher
        return self._intra_process.advertise(publisher)

    def subscribe(
        self,
        kind: Any,
        topic: str,
        callback: Callback,
        profile: QoSProfile,
        *,
        has_one_type: bool = True,
    ) -> Subscription | None:
        """Subscribe to a topic; return None if a node of this process offers it without DDS.

        An exception in ``callback`` is reported, and the node continues. Without ``has_one_type``,
        the caller adapts to publishers of another type.
        """
        guarded = self._guarded(topic, callback)
        if has_one_type:
            self._types.add(self.resolve(topic), kind)
        if self._intra_process is not None and self._intra_process.subscribe(
            self.resolve(topic), guarded
        ):
            return None
        return self.create_subscription(
            kind,
            topic,
            guarded,  # type: ignore[arg-type]  # rclpy leaves out its own second argument
            copy(profile),
            event_callbacks=qos.subscription_events(self.resolve(topic), self.diagnostics.warn),
            qos_overriding_options=qos.overridable(profile),
        )

    def subscribe_info(self, topic: str, callback: Callback) -> None:
        """Subscribe to CameraInfo, also to one that was latched before this node started."""
        name, heard = self.resolve(topic), self._guarded(topic, callback)
        if self.subscribe(CameraInfo, topic, callback, qos.SENSOR_DATA) is None:
            return

        def look() -> None:
            # A publisher that latches nothing would warn of a subscriber that asks for it, and only
            # a reliable one sends what it has latched.
            ends = self.get_publishers_info_by_topic(name)
            if any(qos.is_latched(end.qos_profile) for end in ends):
                timer.cancel()
                quiet = SubscriptionEventCallbacks(use_default_callbacks=False)
                self.create_subscription(
                    CameraInfo,
                    topic,
                    heard,  # type: ignore[arg-type]
                    qos.LATCHED,
                    event_callbacks=quiet,
                )

        timer = every_second(self, look)

    def _guarded(self, topic: str, callback: Callback) -> Callable[[Any, dict[str, Any]], None]:
        def guarded(message: Any, info: dict[str, Any]) -> None:
            try:
                callback(message, int(info["source_timestamp"]))
            except CardboxError as error:
                kind = f"{type(error).__name__} in {topic}"
                self.diagnostics.problem(str(error), kind)
            except Exception as error:
                self._unexpected(f"a message on {self.resolve(topic)}", error)

        return guarded

    def offer(self, name: str, action: Callable[[], str]) -> None:
        """Offer a Trigger service that returns the text of ``action`` or of its error."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = self.outcome(name, action)
            return response

        self.create_service(Trigger, name, answer, qos_profile=qos.SERVICE)

    def outcome(self, name: str, action: Callable[[], str]) -> tuple[bool, str]:
        """Run ``action``; return its success, and its text or that of its error."""
        try:
            text = action()
        except CardboxError as error:
            self.diagnostics.say(f"{name} refused", f"{name}: {error}", warning=True)
            return False, str(error)
        except Exception as error:
            self._unexpected(f"service {name}", error)
            return False, f"unexpected error, see the log of {self.get_name()}: {error!r}"
        self.diagnostics.say(name, f"{name}: {text}")
        return True, text

    def close(self) -> None:
        """Release the resources of the node besides its ROS entities."""

    def _unexpected(self, where: str, error: Exception) -> None:
        if not self.context.ok():
            return  # a signal is ending the node
        text = f"unexpected error in {where}: {error!r}; please report it"
        self.diagnostics.problem(text, f"unexpected error in {where}")
        self.get_logger().debug(traceback.format_exc())


def own_arguments(command_line: list[str]) -> list[str]:
    """Return a command line without program and ROS arguments; wrong ones end it with code 2."""
    try:
        return remove_ros_args(command_line)[1:]
    except Exception as error:
        # The class of this error depends on the release of rclpy.
        print(f"cannot start: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def run_node(create: Callable[[], CardboxNode], args: list[str] | None = None) -> int:
    """Create a node and spin it until it is told to stop; return the process's exit code."""

    def spin(node: CardboxNode) -> None:
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        executor.spin()

    return run(create, args, spin)


def run(create: Callable[[], N], args: list[str] | None, work: Callable[[N], None]) -> int:
    """Create nodes with ``create`` and run ``work`` until ROS ends; return the exit code."""
    try:
        with TemporaryDirectory() as folder:
            rclpy.init(args=in_every_namespace(sys.argv if args is None else args, Path(folder)))
    except Exception as error:
        print(f"cannot start: {error}", file=sys.stderr)
        return 2
    try:
        node = create()
        garbage.keep_all()
        with interrupts.only_noted():
            try:
                work(node)
            finally:
                node.close()
    except CardboxError as error:
        if ok():
            get_logger("cardbox_tracker").fatal(str(error))
            return 1
    except (KeyboardInterrupt, ExternalShutdownException, ROSInterruptException):
        pass
    except Exception:
        # A signal shuts ROS down at any point; exceptions that follow from it are expected.
        if ok() and not interrupts.received():
            raise
    finally:
        try_shutdown()
    return 0
