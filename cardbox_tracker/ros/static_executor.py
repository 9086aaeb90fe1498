"""An executor that does not gather its entities anew for every message.

rclpy's own executor asks each node for its subscriptions, services, timers and QoS events before
every wait and builds a wait set of them: nearly a millisecond where a node has forty of them, with
every picture. Here, as in rclcpp's ``StaticSingleThreadedExecutor``, they are gathered when
something was created or destroyed, and the callback of a subscription is called as soon as it is
ready. All else, which is rare, is left to rclpy: services, timers, events and coroutines.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from inspect import iscoroutinefunction
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities

_FOR_EVER = -1
_KINDS = ("guard_condition", "timer", "client", "service")


class StaticExecutor(SingleThreadedExecutor):
    """Serves nodes in the thread that calls :meth:`spin`; for the rest as its base class."""

    def spin(self) -> None:
        """Serve until shutdown.

        Raises:
            ExternalShutdownException: a signal, or another thread, ended ROS.
        """
        entities: _Entities | None = None
        try:
            while self._context.ok() and not self._is_shutdown:
                if any(not task.done() for task, _, _ in self._tasks):
                    # A coroutine waits for something; rclpy looks after it.
                    self.spin_once()
                    continue
                entities = entities or _Entities(self)
                try:
                    ready, others = entities.wait()
                except InvalidHandle:
                    ready, others = [], True  # a callback destroyed one of them
                if not self._context.ok():
                    raise ExternalShutdownException
                for subscription in ready:
                    with suppress(InvalidHandle):
                        _serve(subscription)
                if others:
                    # Among them the news that something was created or destroyed.
                    entities.release()
                    entities = None
                    self._serve_others()
        finally:
            if entities is not None:
                entities.release()

    def _serve_others(self) -> None:
        with suppress(TimeoutException, ShutdownException):
            while True:
                task, _, _ = self.wait_for_ready_callbacks(timeout_sec=0)
                task()
                if task.exception() is not None:
                    raise task.exception()


def _serve(subscription: Subscription) -> None:
    with subscription.handle:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    if taken is None:
        return
    if subscription._callback_type is Subscription.CallbackType.MessageOnly:
        subscription.callback(taken[0])
    else:
        subscription.callback(*taken)


class _Entities:
    """What the nodes of an executor can be woken by, held until :meth:`release`."""

    def __init__(self, executor: StaticExecutor) -> None:
        nodes = executor.get_nodes()
        subscriptions = [entity for node in nodes for entity in node.subscriptions]
        timers = [entity.handle for node in nodes for entity in node.timers]
        clients = [entity.handle for node in nodes for entity in node.clients]
        services = [entity.handle for node in nodes for entity in node.services]
        guards = [entity.handle for node in nodes for entity in node.guards]
        guards += [executor._guard.handle, executor._sigint_gc.handle]
        handles = [entity.handle for entity in subscriptions]
        self._waitables = [entity for node in nodes for entity in node.waitables]
        self._held = ExitStack()
        for handle in (*handles, *timers, *clients, *services, *guards, *self._waitables):
            self._held.enter_context(handle)
        context = executor.context.handle
        assert context is not None, "spin after ROS was ended"
        self._held.enter_context(context)
        events = NumberOfEntities()
        for waitable in self._waitables:
            events += waitable.get_num_entities()
        self._set = rclpy_implementation.WaitSet(
            len(handles) + events.num_subscriptions,
            len(guards) + events.num_guard_conditions,
            len(timers) + events.num_timers,
            len(clients) + events.num_clients,
            len(services) + events.num_services,
            events.num_events,
            context,
        )
        self._add = [
            *((self._set.add_subscription, handle) for handle in handles),
            *((self._set.add_timer, handle) for handle in timers),
            *((self._set.add_client, handle) for handle in clients),
            *((self._set.add_service, handle) for handle in services),
            *((self._set.add_guard_condition, handle) for handle in guards),
        ]
        # Those whose callbacks are coroutines are left to rclpy.
        self._at_once = {
            entity.handle.pointer: entity
            for entity in subscriptions
            if not iscoroutinefunction(entity.callback)
        }

    def wait(self) -> tuple[list[Any], bool]:
        """Wait until something is ready: subscriptions to serve, and whether anything else is."""
        wait_set = self._set
        # A wait leaves only what is ready in the set.
        wait_set.clear_entities()
        for add, handle in self._add:
            add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(_FOR_EVER)
        found = wait_set.get_ready_entities("subscription")
        ready = [self._at_once[pointer] for pointer in found if pointer in self._at_once]
        others = (
            len(ready) < len(found)
            or any(wait_set.get_ready_entities(kind) for kind in _KINDS)
            or any(waitable.is_ready(wait_set) for waitable in self._waitables)
        )
        return ready, others

    def release(self) -> None:
        """Let go of the entities, so that those destroyed meanwhile can end."""
        self._held.close()
