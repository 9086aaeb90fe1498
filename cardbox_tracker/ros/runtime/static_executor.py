"""An executor that does not gather its entities anew for every message.

rclpy's own executor asks each node for its subscriptions, services, timers and QoS events before
every wait and builds a wait set of them: nearly a millisecond where a node has forty of them, with
every image. Here, as in rclcpp's ``StaticSingleThreadedExecutor``, they are gathered when
something was created or destroyed, and the callback of a subscription is called as soon as it is
ready. All else, which is rare, is left to rclpy: services, timers, events and coroutines.

Of rclpy's Python part only public methods are used or overridden. Of its compiled part the wait set
is needed (:mod:`.wait_set`). Where a version of rclpy lacks any of it, :func:`make_executor`
returns rclpy's own executor instead.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from inspect import iscoroutinefunction, signature
from typing import Any
from weakref import WeakKeyDictionary

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.logging import get_logger
from rclpy.subscription import Subscription
from rclpy.task import Task
from rclpy.utilities import get_default_context

from cardbox_tracker.ros.runtime.wait_set import EntitySet, UnsuitableRclpyError, make_wakers

# A signal wakes the executor shortly before it ends ROS; this long, if that was too early to see.
_LONGEST_WAIT_NS = 1_000_000_000
# What a coroutine waits for may happen without waking anybody.
_COROUTINE_WAIT_NS = 50_000_000


def make_executor(context: Context | None = None) -> SingleThreadedExecutor:
    """Return a :class:`StaticExecutor`, or rclpy's own and one warning where rclpy has changed.

    Args:
        context: of the nodes to serve; None: the default one.
    """
    # Ctrl-C interrupts the main thread only, and rclpy cannot clean up after half an executor.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(_make_executor, context).result()


def _make_executor(context: Context | None) -> SingleThreadedExecutor:
    try:
        return StaticExecutor(context=context)
    except UnsuitableRclpyError as error:
        get_logger("cardbox_tracker").warning(
            f"{error}; nodes run on rclpy's own executor, which takes more time for each message"
        )
        return SingleThreadedExecutor(context=context)


# Names of its own have two underscores: no version of rclpy can take them for something else.
class StaticExecutor(SingleThreadedExecutor):
    """Serves nodes in the thread that calls :meth:`spin`; for the rest as its base class."""

    def __init__(self, *, context: Context | None = None) -> None:
        """Create the executor.

        Args:
            context: of the nodes to serve; None: the default one.

        Raises:
            UnsuitableRclpyError: rclpy lacks something that it needs.
        """
        context = get_default_context() if context is None else context
        self.__entities: EntitySet | None = None
        self.__callbacks = _Callbacks()
        self.__suspended: set[Task] = set()
        self.__ended = False
        self.__wakers = make_wakers(context)
        super().__init__(context=context)

    def __del__(self) -> None:
        """Release what is left; also where a signal interrupted the construction."""
        # rclpy's own expects a construction that was finished, and a context that still exists.
        with suppress(AttributeError, InvalidHandle, ValueError):
            super().__del__()

    def wake(self) -> None:
        """Look again for what there is to serve."""
        super().wake()
        self.__wake()

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Have a function or coroutine executed by :meth:`spin`; return its future."""
        task = super().create_task(callback, *args, **kwargs)
        self.__wake()
        return task

    def add_node(self, node: Any) -> bool:
        """Serve a node as well; return whether it is new."""
        added: bool = super().add_node(node)
        self.__wake()
        return added

    def remove_node(self, node: Any) -> None:
        """Serve a node no longer."""
        super().remove_node(node)
        self.__wake()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End :meth:`spin`; return whether no callback is running any more."""
        self.__ended = True
        self.__wake()
        done: bool = super().shutdown(timeout_sec)
        for guard in self.__wakers:
            with suppress(InvalidHandle):
                guard.destroy()
        return done

    def spin(self) -> None:
        """Serve until shutdown.

        Raises:
            ExternalShutdownException: a signal, or another thread, ended ROS.
        """
        try:
            while self.context.ok() and not self.__ended:
                self.__serve_once()
        finally:
            self.__let_go()

    def __wake(self) -> None:
        with suppress(InvalidHandle):
            self.__wakers[0].trigger()

    def __serve_once(self) -> None:
        try:
            entities = self.__entities = self.__entities or EntitySet(self, self.__wakers)
            entities.wait(_COROUTINE_WAIT_NS if self.__suspended else _LONGEST_WAIT_NS)
        except InvalidHandle:
            # A callback destroyed one of them.
            self.__let_go()
            return
        if not self.context.ok():
            raise ExternalShutdownException
        left_to_rclpy = False
        for subscription in entities.ready_subscriptions():
            left_to_rclpy |= not self.__callbacks.serve(subscription)
        if left_to_rclpy or self.__suspended or entities.others_are_ready():
            # Among them the news that something was created or destroyed.
            entities.hand_back_guards()
            self.__let_go()
            self.__serve_others()

    def __let_go(self) -> None:
        if self.__entities is not None:
            self.__entities.release()
            self.__entities = None

    def __serve_others(self) -> None:
        # What was served may be what a coroutine waits for.
        with suppress(ShutdownException):
            while self.__serve_each_once() and self.__suspended:
                pass

    def __serve_each_once(self) -> bool:
        """Return whether there was more than coroutines that still wait."""
        progress = False
        with suppress(TimeoutException):
            while True:
                # Always these arguments: with others rclpy would begin anew, in the midst of them.
                task, _, _ = self.wait_for_ready_callbacks(timeout_sec=0)
                task()
                progress |= task not in self.__suspended
                self.__suspended.add(task)
        ended = {task for task in self.__suspended if task.done() or task.cancelled()}
        self.__suspended -= ended
        for task in ended:
            if task.exception() is not None:
                raise task.exception()
        return progress or bool(ended)


class _Callbacks:
    """Calls the callbacks of subscriptions in the way they ask for."""

    def __init__(self) -> None:
        # What a callback is like is found out once: that takes longer than most callbacks.
        self._known: WeakKeyDictionary[Subscription, tuple[Any, bool, bool]] = WeakKeyDictionary()

    def serve(self, subscription: Subscription) -> bool:
        """Take one message; return False, without taking it, if the callback is a coroutine."""
        callback, is_coroutine, with_info = self._known.get(subscription, (None, False, False))
        if callback is not subscription.callback:
            callback = subscription.callback
            is_coroutine, with_info = iscoroutinefunction(callback), _wants_info(callback)
            self._known[subscription] = callback, is_coroutine, with_info
        if is_coroutine:
            return False
        try:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        except InvalidHandle:
            return True  # the callback before destroyed it
        if taken is not None:
            message, info = taken
            if with_info:
                callback(message, info)
            else:
                callback(message)
        return True


def _wants_info(callback: Callable[..., Any]) -> bool:
    """Return whether it takes a second argument, as rclpy decides it."""
    try:
        signature(callback).bind(object())
    except TypeError:
        return True
    return False
