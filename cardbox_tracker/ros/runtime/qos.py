"""Overridable quality of service of every topic (REP-2003), and texts about mismatches.

Drivers publish reliable or best effort; subscribers of sensor data ask for best effort. Topics that
describe a state (models, background) are latched: a late subscriber gets the last message.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import (
    DurabilityPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_policy_name_from_kind,
)
from rclpy.qos_overriding_options import QoSOverridingOptions

SENSOR_DATA = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
# A slow subscriber gets the newest image, not those that came while it worked.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# Reliable publishers match subscribers of either kind (REP-2003).
CAMERA = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
SILHOUETTE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
# With a queue of five, a subscriber may fall behind by some images.
SILHOUETTE_INPUT = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
# Of commands and states of a robot, only the newest counts.
LATEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
RESULT = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
# A player can wait for a slow subscriber, and the queue holds 100 images.
PLAYED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# Calls wait while a node is busy, and a queue of ten, ROS's default, loses the others.
SERVICE = QoSProfile(depth=10_000, reliability=ReliabilityPolicy.RELIABLE)
# A subscriber that records a replay must not lose a message.
REPLAY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# Lines that follow each other at once must not replace each other before they are sent.
LATCHED_LINES = QoSProfile(
    depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
# tf2's listener uses the same profile, because several programs publish latched messages.
STATIC_TRANSFORMS = QoSProfile(
    depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)

# Words for a weak and a strong policy, and the values of their parameters.
_MEANING = {
    "RELIABILITY": ("best effort", "reliable", "best_effort", "reliable"),
    "DURABILITY": ("volatile", "latched (transient local)", "volatile", "transient_local"),
}


def overridable(profile: QoSProfile) -> QoSOverridingOptions:
    """Return options that declare ``qos_overrides.<topic>...``, if latched without durability."""
    kinds = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY]
    if profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        kinds.append(QoSPolicyKind.DURABILITY)
    return QoSOverridingOptions(kinds)


def is_latched(profile: QoSProfile) -> bool:
    """Return whether a publisher sends its last message to a subscriber that comes later."""
    return (profile.durability, profile.reliability) == (LATCHED.durability, LATCHED.reliability)


def mismatch_text(topic: str, kind: QoSPolicyKind, subscribing: bool) -> str:
    """Return an explanation of a QoS mismatch; ``subscribing`` is False if this node publishes."""
    name = qos_policy_name_from_kind(kind)
    weak, strong, low, high = _MEANING.get(name, ("less", "more", "volatile", "transient_local"))
    policy = name.lower()
    ours, value = ("subscription", low) if subscribing else ("publisher", high)
    remedy = f"start this node with the parameter qos_overrides.{topic}.{ours}.{policy}:={value}"
    if subscribing:
        return (
            f"incompatible QoS on {topic}: a publisher offers {weak} {policy} but this node asks "
            f"for {strong}, so nothing arrives from it; make that publisher {strong}, or {remedy}"
        )
    return (
        f"incompatible QoS on {topic}: a subscriber asks for {strong} {policy} but this node "
        f"offers {weak}, so it receives nothing; make that subscriber {weak}, or {remedy}"
    )


def _reports(topic: str, report: Callable[[str], None], subscribing: bool) -> Callable[[Any], None]:
    return lambda event: report(mismatch_text(topic, event.last_policy_kind, subscribing))


def subscription_events(topic: str, report: Callable[[str], None]) -> SubscriptionEventCallbacks:
    """Return callbacks that pass a mismatch of QoS on ``topic`` to ``report``."""
    # The default callbacks wait for other events, which lengthens every wait of the executor.
    return SubscriptionEventCallbacks(
        incompatible_qos=_reports(topic, report, True), use_default_callbacks=False
    )


def publisher_events(topic: str, report: Callable[[str], None]) -> PublisherEventCallbacks:
    """Return callbacks that pass a mismatch of QoS on ``topic`` to ``report``."""
    return PublisherEventCallbacks(
        incompatible_qos=_reports(topic, report, False), use_default_callbacks=False
    )
