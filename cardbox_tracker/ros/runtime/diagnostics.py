"""The state of a node on ``/diagnostics`` once a second, and in its log when it changes.

A node that publishes nothing yet reports what it waits for. Lost images are counted by the spacing
of their stamps, since the middleware does not report them.
"""

from __future__ import annotations

import time
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Callable

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

PERIOD_S = 1.0
_REPEAT_S = 10.0
_WINDOW = 120
_PAUSE_NS = 2_000_000_000

STATUS = "status"
"""Key of the value that says whether a node is ``waiting``, ``working`` or has an ``error``."""

WAITING, WORKING, ERROR = "waiting", "working", "error"


class StreamStatistics:
    """Counts the messages of one stream, and by their stamps those that never arrived."""

    def __init__(self) -> None:
        """Start with nothing received."""
        self.received = 0
        self.dropped = 0
        self.out_of_order = 0
        self._last_ns: int | None = None
        self._spacings_ns: deque[int] = deque()
        # The same, sorted: the period is needed with every image.
        self._ordered_ns: list[int] = []

    def add(self, stamp_ns: int) -> bool:
        """Count a message of that stamp; return False if it is not later than the one before."""
        self.received += 1
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None:
            return True
        spacing_ns = stamp_ns - last_ns
        if spacing_ns <= 0:
            self.out_of_order += 1
            self._spacings_ns.clear()
            self._ordered_ns.clear()
            return False
        if spacing_ns < _PAUSE_NS:
            self._note(spacing_ns)
            if len(self._spacings_ns) >= 5:
                self.dropped += max(round(spacing_ns / self.period_ns) - 1, 0)
        return True

    def _note(self, spacing_ns: int) -> None:
        if len(self._spacings_ns) == _WINDOW:
            del self._ordered_ns[bisect_left(self._ordered_ns, self._spacings_ns.popleft())]
        self._spacings_ns.append(spacing_ns)
        insort(self._ordered_ns, spacing_ns)

    @property
    def period_ns(self) -> int:
        """Spacing of the stamps without losses, ns.

        A low percentile: where most images are lost, the median is a multiple of the period.
        """
        return self._ordered_ns[len(self._ordered_ns) // 10] if self._ordered_ns else 0

    @property
    def loss(self) -> float:
        """Fraction of the latest messages that never arrived, judged by their stamps."""
        if len(self._spacings_ns) < 5:
            return 0.0
        expected = max(round(sum(self._spacings_ns) / self.period_ns), 1)
        return max(1.0 - len(self._spacings_ns) / expected, 0.0)


class NodeDiagnostics:
    """State, rates, latency and losses of one node.

    Attributes:
        input: the images or silhouettes that drive the node.
        extra: called once a second for further values, name to text.
        advice: called once a second for warnings that come and go, such as lost images.
        remarks: the same of what every node watches, such as the types of its topics.
    """

    def __init__(self, node: Node) -> None:
        """Publish for ``node`` from now on."""
        self.input = StreamStatistics()
        self.extra: Callable[[], dict[str, str]] = dict
        self.advice: Callable[[], list[str]] = list
        self.remarks: Callable[[], list[str]] = list
        self._node = node
        self._waiting = ""
        self._problem = ""
        self._said: dict[str, float] = {}
        self._warnings: list[str] = []
        self._published = self._late = 0
        self._latencies_ms: deque[float] = deque(maxlen=_WINDOW)
        self._before = (time.monotonic(), 0, 0)
        self._publisher = node.create_publisher(
            DiagnosticArray, "/diagnostics", QoSProfile(depth=10)
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD_S, self._tick, clock=steady)

    def wait_for(self, text: str) -> None:
        """Report that the node publishes nothing until ``text`` arrives."""
        self._waiting, self._problem = text, ""
        if self._is_news(text):
            self._node.get_logger().info(f"waiting for {text}")

    def problem(self, text: str) -> None:
        """Report an error; it is shown until :meth:`working`."""
        self._problem = text
        if self._is_news(text):
            self._node.get_logger().error(text)

    def working(self, sent_ns: int = 0) -> None:
        """Count an output; ``sent_ns`` is when its input left the sender, ns since the epoch."""
        if self._waiting or self._problem:
            self._waiting = self._problem = ""
            self._said.clear()
        self._published += 1
        if sent_ns > 0:
            latency_ns = time.time_ns() - sent_ns
            self._latencies_ms.append(latency_ns / 1e6)
            # The next image was due before this one was done.
            self._late += 0 < self.input.period_ns < latency_ns

    def warn(self, text: str) -> None:
        """Add a warning that stays, such as an incompatible QoS."""
        if text not in self._warnings:
            self._warnings.append(text)
            self._node.get_logger().warning(text)

    def _is_news(self, text: str) -> bool:
        """True if ``text`` was not logged for a while; takes note of it."""
        now = time.monotonic()
        if now - self._said.get(text, -_REPEAT_S) < _REPEAT_S:
            return False
        self._said[text] = now
        return True

    def _tick(self) -> None:
        if self._problem:
            self.problem(self._problem)
        elif self._waiting:
            self.wait_for(self._waiting)
        status = self._status()
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _status(self) -> DiagnosticStatus:
        now, received, published = time.monotonic(), self.input.received, self._published
        before, received_before, published_before = self._before
        self._before = (now, received, published)
        span_s = max(now - before, 1e-3)
        warnings = self._warnings + self.remarks() + self.advice()
        if self._problem:
            state, level, text = ERROR, DiagnosticStatus.ERROR, self._problem
        elif self._waiting:
            state, level, text = WAITING, DiagnosticStatus.WARN, f"waiting for {self._waiting}"
        elif warnings:
            state, level, text = WORKING, DiagnosticStatus.WARN, warnings[-1]
        else:
            state, level, text = WORKING, DiagnosticStatus.OK, "working"
        values = {
            STATUS: state,
            "rate in (Hz)": f"{(received - received_before) / span_s:.1f}",
            "rate out (Hz)": f"{(published - published_before) / span_s:.1f}",
            "received": str(received),
            "published": str(published),
            "dropped (by stamps)": str(self.input.dropped),
            "late": str(self._late),
            "out of order (by stamps)": str(self.input.out_of_order),
        }
        if self._latencies_ms:
            values["latency p95 (ms)"] = f"{np.percentile(self._latencies_ms, 95):.2f}"
        values |= self.extra()
        values |= {f"warning {i}": warning for i, warning in enumerate(warnings, 1)}
        name = self._node.get_fully_qualified_name().lstrip("/")
        return DiagnosticStatus(
            level=level,
            name=f"{name}: {self._node.get_name()}",
            message=text,
            hardware_id="cardbox_tracker",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
