"""The wait set of an executor, held over many waits; the compiled part of rclpy that it relies on.

No documentation promises the interface of rclpy's wait set, so ``RELIED_ON`` lists what is used of
it, and :func:`make_wakers` checks all of that once, when an executor is made.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

from rclpy import signals
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor
from rclpy.guard_condition import GuardCondition
from rclpy.subscription import Subscription
from rclpy.waitable import NumberOfEntities

try:
    from rclpy.impl.implementation_singleton import rclpy_implementation
except ImportError:
    rclpy_implementation = None

RELIED_ON = (
    "rclpy_implementation.GuardCondition.pointer",
    "rclpy_implementation.Subscription.__enter__",
    "rclpy_implementation.Subscription.pointer",
    "rclpy_implementation.Subscription.take_message",
    "rclpy_implementation.WaitSet",
    "rclpy_implementation.WaitSet.add_client",
    "rclpy_implementation.WaitSet.add_guard_condition",
    "rclpy_implementation.WaitSet.add_service",
    "rclpy_implementation.WaitSet.add_subscription",
    "rclpy_implementation.WaitSet.add_timer",
    "rclpy_implementation.WaitSet.clear_entities",
    "rclpy_implementation.WaitSet.get_ready_entities",
    "rclpy_implementation.WaitSet.wait",
    "signals.SignalHandlerGuardCondition",
)
"""What is used of rclpy without being documented; looked up once, when an executor is made."""


_KINDS = ("guard_condition", "timer", "client", "service")


class UnsuitableRclpyError(RuntimeError):
    """This version of rclpy lacks something that :class:`StaticExecutor` needs."""


def make_wakers(context: Context) -> list[GuardCondition]:
    """Return what wakes a wait: this executor itself, then signals.

    Raises:
        UnsuitableRclpyError: rclpy lacks something.
    """
    here = SimpleNamespace(rclpy_implementation=rclpy_implementation, signals=signals)
    missing = [name for name in RELIED_ON if not _has(here, name)]
    if missing:
        raise UnsuitableRclpyError(f"rclpy has no {', '.join(missing)}")
    waker = GuardCondition(callback=None, callback_group=None, context=context)
    try:
        on_signal = signals.SignalHandlerGuardCondition(context)
        _try_wait_set(waker, context)
    except Exception as error:
        if not context.ok():
            raise  # a signal ended ROS meanwhile
        raise UnsuitableRclpyError(f"rclpy's wait set has changed ({error!r})") from error
    return [waker, on_signal]


def _has(owner: object, name: str) -> bool:
    try:
        attrgetter(name)(owner)
    except AttributeError:
        return False
    return True


def _try_wait_set(guard: GuardCondition, context: Context) -> None:
    with guard.handle:
        wait_set = _wait_set(NumberOfEntities(0, 1), context)
        wait_set.clear_entities()
        wait_set.add_guard_condition(guard.handle)
        guard.trigger()
        wait_set.wait(0)
        if guard.handle.pointer not in wait_set.get_ready_entities("guard_condition"):
            raise RuntimeError("it does not report what is ready")


def _wait_set(number: NumberOfEntities, context: Context) -> Any:
    return rclpy_implementation.WaitSet(
        number.num_subscriptions,
        number.num_guard_conditions,
        number.num_timers,
        number.num_clients,
        number.num_services,
        number.num_events,
        context.handle,
    )


class EntitySet:
    """What the nodes of an executor can be woken by, held until :meth:`release`."""

    def __init__(self, executor: Executor, wakers: list[GuardCondition]) -> None:
        """Gather them.

        Args:
            executor: whose nodes they are of.
            wakers: what wakes the executor itself.

        Raises:
            InvalidHandle: something was destroyed meanwhile.
        """
        nodes = executor.get_nodes()

        def all_of(kind: str) -> list[Any]:
            # While a coroutine waits, others of its callback group must.
            return [e for node in nodes for e in getattr(node, kind) if executor.can_execute(e)]

        subscriptions = all_of("subscriptions")
        self._guards = all_of("guards")
        self._waitables = all_of("waitables")
        handles = [entity.handle for entity in subscriptions]
        timers = [entity.handle for entity in all_of("timers")]
        clients = [entity.handle for entity in all_of("clients")]
        services = [entity.handle for entity in all_of("services")]
        guards = [entity.handle for entity in (*self._guards, *wakers)]
        context = executor.context.handle
        assert context is not None, "spin after ROS was ended"
        with ExitStack() as stack:
            for handle in (*handles, *timers, *clients, *services, *guards, context):
                stack.enter_context(handle)
            for waitable in self._waitables:
                stack.enter_context(waitable)
            self._held = stack.pop_all()
        number = NumberOfEntities(
            len(handles), len(guards), len(timers), len(clients), len(services)
        )
        for waitable in self._waitables:
            number += waitable.get_num_entities()
        self._set = _wait_set(number, executor.context)
        self._add = [
            *((self._set.add_subscription, handle) for handle in handles),
            *((self._set.add_timer, handle) for handle in timers),
            *((self._set.add_client, handle) for handle in clients),
            *((self._set.add_service, handle) for handle in services),
            *((self._set.add_guard_condition, handle) for handle in guards),
        ]
        self._subscriptions = {entity.handle.pointer: entity for entity in subscriptions}

    def wait(self, longest_ns: int) -> None:
        """Wait until something is ready, or for ``longest_ns``.

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
        wait_set.wait(longest_ns)

    def ready_subscriptions(self) -> list[Subscription]:
        """Return those that have a message."""
        found = self._found("subscription")
        # A waitable may have subscriptions of its own in the set.
        return [self._subscriptions[pointer] for pointer in found if pointer in self._subscriptions]

    def others_are_ready(self) -> bool:
        """Return whether there is anything for rclpy to look after besides subscriptions."""
        return any(self._found(kind) for kind in _KINDS) or any(
            waitable.is_ready(self._set) for waitable in self._waitables
        )

    def hand_back_guards(self) -> None:
        """Trigger the guard conditions of nodes again: to find them ready took them from rclpy."""
        found = self._found("guard_condition")
        for guard in self._guards:
            if guard.handle.pointer in found:
                with suppress(InvalidHandle):
                    guard.trigger()

    def _found(self, kind: str) -> list[int]:
        pointers: list[int] = self._set.get_ready_entities(kind)
        return pointers

    def release(self) -> None:
        """Let go of the entities, so that those destroyed meanwhile can end."""
        self._held.close()
