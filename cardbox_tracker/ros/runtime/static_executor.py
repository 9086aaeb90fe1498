"""An executor that does not gather its entities anew for every message.

rclpy's own executor asks each node for its subscriptions, services, timers and QoS events before
every wait and builds a wait set of them: nearly a millisecond where a node has forty of them, with
every image. Here, as in rclcpp's ``StaticSingleThreadedExecutor``, they are gathered when
something was created or destroyed, and the callback of a subscription is called as soon as it is
ready. All else, which is rare, is left to rclpy: services, timers, events and coroutines.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from inspect import iscoroutinefunction

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

    _entities: _Entities | None = None

    def spin(self) -> None:
        """Serve until shutdown.

        Raises:
            ExternalShutdownException: a signal, or another thread, ended ROS.
        """
        try:
            while self._context.ok() and not self._is_shutdown:
                if any(not task.done() for task, _, _ in self._tasks):
                    # A coroutine waits for something; rclpy looks after it.
                    self._let_go()
                    self.spin_once()
                else:
                    self._serve_once()
        finally:
            self._let_go()

    def _serve_once(self) -> None:
        try:
            entities = self._entities = self._entities or _Entities(self)
            entities.wait()
        except InvalidHandle:
            # A callback destroyed one of them.
            self._let_go()
            return
        if not self._context.ok():
            raise ExternalShutdownException
        for subscription in entities.ready_subscriptions():
            _serve(subscription)
        if entities.others_are_ready():
            # Among them the news that something was created or destroyed.
            self._let_go()
            self._serve_others()

    def _let_go(self) -> None:
        if self._entities is not None:
            self._entities.release()
            self._entities = None

    def _serve_others(self) -> None:
        with suppress(TimeoutException, ShutdownException):
            while True:
                task, _, _ = self.wait_for_ready_callbacks(timeout_sec=0)
                task()
                if task.exception() is not None:
                    raise task.exception()


def _serve(subscription: Subscription) -> None:
    try:
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
    except InvalidHandle:
        return  # the callback before destroyed it
    if taken is None:
        return
    if subscription._callback_type is Subscription.CallbackType.MessageOnly:
        subscription.callback(taken[0])
    else:
        subscription.callback(*taken)


class _Entities:
    """What the nodes of an executor can be woken by, held until :meth:`release`."""

    def __init__(self, executor: StaticExecutor) -> None:
        """Gather them.

        Raises:
            InvalidHandle: something was destroyed meanwhile.
        """
        nodes = executor.get_nodes()
        subscriptions = [entity for node in nodes for entity in node.subscriptions]
        timers = [entity.handle for node in nodes for entity in node.timers]
        clients = [entity.handle for node in nodes for entity in node.clients]
        services = [entity.handle for node in nodes for entity in node.services]
        guards = [entity.handle for node in nodes for entity in node.guards]
        guards += [executor._guard.handle, executor._sigint_gc.handle]
        handles = [entity.handle for entity in subscriptions]
        self._waitables = [entity for node in nodes for entity in node.waitables]
        context = executor.context.handle
        assert context is not None, "spin after ROS was ended"
        with ExitStack() as stack:
            for handle in (*handles, *timers, *clients, *services, *guards, context):
                stack.enter_context(handle)
            for waitable in self._waitables:
                stack.enter_context(waitable)
            self._held = stack.pop_all()
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

    def wait(self) -> None:
        """Wait until something is ready.

        Raises:
            InvalidHandle: something was destroyed.
        """
        wait_set = self._set
        # A wait leaves only what is ready in the set.
        wait_set.clear_entities()
        for add, handle in self._add:
            add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(_FOR_EVER)

    def ready_subscriptions(self) -> list[Subscription]:
        """Return those that have a message, but for those that rclpy looks after."""
        found = self._found("subscription")
        return [self._at_once[pointer] for pointer in found if pointer in self._at_once]

    def others_are_ready(self) -> bool:
        """Return whether there is anything for rclpy to look after."""
        return (
            any(pointer not in self._at_once for pointer in self._found("subscription"))
            or any(self._found(kind) for kind in _KINDS)
            or any(waitable.is_ready(self._set) for waitable in self._waitables)
        )

    def _found(self, kind: str) -> list[int]:
        pointers: list[int] = self._set.get_ready_entities(kind)
        return pointers

    def release(self) -> None:
        """Let go of the entities, so that those destroyed meanwhile can end."""
        self._held.close()
