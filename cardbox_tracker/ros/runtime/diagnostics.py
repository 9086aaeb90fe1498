"""The state of a node on ``/diagnostics`` once a second, and in its log when it changes.

Lost images are counted by their stamps, because the middleware does not report them.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.timer import Timer

from cardbox_tracker.camera.stamps import WINDOW, ArrivalWatch, StampOrder, StreamStatistics
from cardbox_tracker.common.errors import plain
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.ros.runtime import qos

_TEXTS = 3
_FIRST_PAUSE_S = 10.0
_LONGEST_PAUSE_S = 600.0


@dataclass
class _Spell:
    """Messages of one kind since its last quiet period."""

    texts: set[str] = field(default_factory=set)
    pause_s: float = _FIRST_PAUSE_S
    next_s: float = 0.0
    seen_s: float = 0.0


class LogLimit:
    """Allows the first texts of a kind, then one text after each of growing pauses.

    A sender of always different nonsense would otherwise fill log and memory. A kind that was quiet
    for longer than its pause starts anew.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._spells: dict[str, _Spell] = {}

    def allows(self, kind: str, text: str) -> bool:
        """Return whether to log ``text``, and count it."""
        now_s = self._now_s()
        spell = self._spells.get(kind)
        if spell is None or now_s - spell.seen_s > 2 * spell.pause_s:
            spell = self._spells[kind] = _Spell()
        spell.seen_s = now_s
        is_new = text not in spell.texts and len(spell.texts) < _TEXTS
        if not is_new and now_s < spell.next_s:
            return False
        if is_new:
            spell.texts.add(text)
        else:
            spell.pause_s = min(2 * spell.pause_s, _LONGEST_PAUSE_S)
        spell.next_s = now_s + spell.pause_s
        return True


def every_second(node: Node, call: Callable[[], None]) -> Timer:
    """Call a function once a second, also while the time of a simulation stands still."""
    return node.create_timer(1.0, call, clock=Clock(clock_type=ClockType.STEADY_TIME))


# The input of a slow camera has ceased after this number of periods without a message.
_SILENT_PERIODS = 5.0
# An image that is older has a stamp of another clock, as those of a recording.
_OLDEST_MS = 10_000.0

_CEASED = "is the camera running and connected, and every node between it and this one?"
_PLAYED = (
    "play_bag plays a recording, which may be paused; if not, is every node in between running?"
)
# Only the node play_bag has this topic.
_PLAYING = "/play_bag/status"

STATUS = "status"
"""Key of the node's state: ``waiting``, ``working`` or ``error``."""

WAITING, WORKING, ERROR = "waiting", "working", "error"


class NodeDiagnostics:
    """State, rates, latency and losses of one node.

    Attributes:
        input: the images or silhouettes that drive the node.
        arrivals: when they arrive, as far as :meth:`arrived` was called.
        extra: called once a second; returns further values, text by name.
        source: name of the input, such as "images on /image_raw", for the report that it has
            ceased.
        advice: called once a second; returns temporary warnings, such as lost images, text by kind.
            Warnings of the kind "" are not logged here, because the node logs them.
        remarks: as ``advice``, for what all nodes check, such as the types of their topics.
        remedy: what to do if results take longer than the period of the images; empty if that is
            no fault of this node, which then reports nothing.
    """

    def __init__(self, node: Node) -> None:
        self.input = StreamStatistics()
        self.arrivals = ArrivalWatch()
        self.extra: Callable[[], dict[str, str]] = dict
        self.advice: Callable[[], dict[str, str]] = dict
        self.source = ""
        self.remarks: Callable[[], dict[str, str]] = dict
        self.remedy = ""
        self._node = node
        self._waiting = ""
        self._problem = ""
        self._kind = ""
        self._log = LogLimit()
        self._silence = ""
        self._is_played = False
        self._arrived = (0, time.monotonic())
        self._warnings: list[str] = []
        self._published = self._late = 0
        self._slow = Verdict("slow", self._periods)
        self._made = ""
        self._ages_ms: deque[float] = deque(maxlen=WINDOW)
        self._before = (time.monotonic(), 0, 0)
        self._publisher = node.create_publisher(
            DiagnosticArray,
            "/diagnostics",
            QoSProfile(depth=10),
            event_callbacks=qos.publisher_events("/diagnostics", self.warn),
        )
        self._timer = every_second(node, self.publish)

    def arrived(self, stamp_ns: int) -> StampOrder:
        """Count a live message of the input, and return its relation to the one before."""
        order = self.input.add(stamp_ns)
        clock_ns = self._node.get_clock().now().nanoseconds
        self.arrivals.add(stamp_ns, order, time.monotonic(), clock_ns)
        return order

    def wait_for(self, text: str) -> None:
        """Report that the node publishes nothing until ``text`` arrives."""
        text = plain(text)
        self._waiting, self._problem = text, ""
        if self._log.allows(WAITING, text):
            self._node.get_logger().info(f"waiting for {text}")

    def problem(self, text: str, kind: str = ERROR) -> None:
        """Report an error until :meth:`working`; errors of one ``kind`` share a log limit."""
        text = plain(text)
        self._problem, self._kind = text, kind
        if self._log.allows(kind, text):
            self._node.get_logger().error(text)

    def say(self, kind: str, text: str, *, warning: bool = False) -> None:
        """Log an event that other programs can cause at any rate, within the log limit."""
        text = plain(text)
        if self._log.allows(kind, text):
            # rclpy allows only one level per line of code.
            if warning:
                self._node.get_logger().warning(text)
            else:
                self._node.get_logger().info(text)

    def working(self, sent_ns: int = 0) -> None:
        """Count an output; ``sent_ns`` is the send time of its input, ns since the epoch."""
        self._waiting = self._problem = ""
        self._published += 1
        if sent_ns > 0:
            latency_ns = time.time_ns() - sent_ns
            self._slow.see(latency_ns)
            # The next image was due before this one was done.
            self._late += 0 < self.input.period_ns < latency_ns

    def made(self, what: str, stamp_ns: int) -> None:
        """Take the age of an image, by its stamp, at ``what`` was made of it."""
        age_ns = self._node.get_clock().now().nanoseconds - stamp_ns
        self._made = what
        self._ages_ms.append(age_ns / 1e6)

    def _ages(self) -> dict[str, str]:
        """Return the median and 95 % of the ages of the last images."""
        ages_ms = np.percentile(self._ages_ms or [-1.0], (50, 95)).tolist()
        if not 0.0 <= ages_ms[0] <= ages_ms[1] < _OLDEST_MS:
            return {}
        names = (f"image to {self._made} p{share} (ms)" for share in (50, 95))
        return {name: f"{age_ms:.1f}" for name, age_ms in zip(names, ages_ms, strict=True)}

    def warn(self, text: str) -> None:
        """Add a permanent warning, such as an incompatible QoS."""
        text = plain(text)
        if text not in self._warnings:
            self._warnings.append(text)
            self._node.get_logger().warning(text)

    def _look_for_silence(self) -> None:
        received, since_s = self._arrived
        now_s = time.monotonic()
        if self.input.received != received:
            self._arrived = self.input.received, now_s
            if self._silence:
                self._silence = ""
                self._node.get_logger().info(f"{self.source} arrive again")
            return
        silent_s = now_s - since_s
        is_slow = silent_s < _SILENT_PERIODS * self.input.period_ns / 1e9
        if is_slow or not (received and self.source and WATCHES["ceased"].is_beyond(silent_s)):
            return
        # The player may have been paused, which is not a fault and cannot be detected here.
        topics = self._node.get_topic_names_and_types()
        self._is_played = any(name.endswith(_PLAYING) for name, _ in topics)
        why = _PLAYED if self._is_played else _CEASED
        if not self._silence and self._is_played:
            self._node.get_logger().info(f"{self.source} have ceased: {why}")
        elif not self._silence:
            self._node.get_logger().warning(f"{self.source} have ceased: {why}")
        self._silence = WATCHES["ceased"].remark(silent_s, source=self.source, why=why)

    @property
    def is_slow(self) -> bool:
        """Whether results take longer than the period of images that come evenly."""
        return self._slow.holds and not self.arrivals.has_burst

    def _periods(self, latency_ns: float) -> float:
        return latency_ns / self.input.period_ns if self.input.period_ns else 0.0

    def _slowness(self) -> dict[str, str]:
        if not self.remedy or not self.is_slow:
            return {}
        latency_ms, period_ms = self._slow.medians[0] / 1e6, self.input.period_ns / 1e6
        given = {"latency_ms": latency_ms, "period_ms": period_ms, "remedy": self.remedy}
        return {"slow": self._slow.remark(**given)}

    def _remarks(self) -> list[str]:
        """Return all current warnings, and log each new kind."""
        found = self.remarks() | self.input.remarks() | self.arrivals.remarks()
        found |= self._slowness() | self.advice()
        found = {kind: plain(text) for kind, text in found.items()}
        for kind, text in found.items():
            if kind and self._log.allows(kind, kind):
                self._node.get_logger().warning(text)
        return [*self._warnings, *found.values()]

    def publish(self) -> None:
        """Publish the status and log its changes; a timer calls this once a second."""
        self._look_for_silence()
        if self._problem and not self._silence:
            self.problem(self._problem, self._kind)
        elif self._waiting and not self._silence:
            self.wait_for(self._waiting)
        status = self.status()
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def status(self) -> DiagnosticStatus:
        """Return the status, with the rates since the last call."""
        now, received, published = time.monotonic(), self.input.received, self._published
        before, received_before, published_before = self._before
        self._before = (now, received, published)
        span_s = max(now - before, 1e-3)
        warnings = self._remarks()
        if self._silence:
            level = DiagnosticStatus.WARN if self._is_played else DiagnosticStatus.ERROR
            state, text = WAITING, f"waiting for {self._silence}"
        elif self._problem:
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
        if self._slow.samples:
            values["latency p95 (ms)"] = f"{np.percentile(self._slow.samples, 95) / 1e6:.2f}"
        values |= self._ages() | self.extra()
        values |= {f"warning {i}": warning for i, warning in enumerate(warnings, 1)}
        name = self._node.get_fully_qualified_name().lstrip("/")
        return DiagnosticStatus(
            level=level,
            name=f"{name}: {self._node.get_name()}",
            message=text,
            hardware_id="cardbox_tracker",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
