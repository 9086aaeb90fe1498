"""Quality of service of every topic (REP-2003), overridable; mismatches in plain words.

Drivers publish reliable or best effort; subscribers of sensor data ask for best effort. Topics that
describe a state (models, background) are latched: a late subscriber gets the last message.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
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
# Reliable publishers match subscribers of either kind (REP-2003).
CAMERA = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
SILHOUETTE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
# A queue of five lets the subscriber be late by some images; the publisher keeps only the latest.
SILHOUETTE_INPUT = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)
RESULT = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
# As tf2's own broadcasters and listeners have it.
TF = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# A recording may wait for a slow subscriber; no image is lost while 100 are queued.
PLAYED = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# For a subscriber that records a replay and must not miss a message.
REPLAY = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
# As tf2 listens: several programs publish, each of them latched.
STATIC_TRANSFORMS = QoSProfile(
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

_MEANING = {
    "RELIABILITY": ("best effort", "reliable", "reliability"),
    "DURABILITY": ("volatile", "latched (transient local)", "durability"),
}


def overridable(profile: QoSProfile) -> QoSOverridingOptions:
    """Return options that declare ``qos_overrides.<topic>...`` parameters.

    Durability can be overridden except on latched topics, which depend on it.
    """
    kinds = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY]
    if profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        kinds.append(QoSPolicyKind.DURABILITY)
    return QoSOverridingOptions(kinds)


def copy_of(profile: QoSProfile) -> QoSProfile:
    """Return a profile of the same policies; overriding one changes the object it is given."""
    return QoSProfile(
        history=profile.history,
        depth=profile.depth,
        reliability=profile.reliability,
        durability=profile.durability,
    )


def mismatch_text(topic: str, kind: QoSPolicyKind, *, subscribing: bool) -> str:
    """Say in plain words why a publisher and a subscriber of ``topic`` do not talk.

    Args:
        topic: the resolved topic name.
        kind: the policy that does not match.
        subscribing: True if this node is the subscriber, False if it publishes.
    """
    name = qos_policy_name_from_kind(kind)
    weak, strong, policy = _MEANING.get(name, ("less", "more", name.lower()))
    ours = "subscription" if subscribing else "publisher"
    wanted = "best_effort" if policy == "reliability" else "volatile"
    offered = "reliable" if policy == "reliability" else "transient_local"
    override = f"qos_overrides.{topic}.{ours}.{policy}"
    if subscribing:
        return (
            f"incompatible QoS on {topic}: a publisher offers {weak} {policy} but this node asks "
            f"for {strong}, so nothing arrives from it; make that publisher {strong}, or start "
            f"this node with the parameter {override}:={wanted}"
        )
    return (
        f"incompatible QoS on {topic}: a subscriber asks for {strong} {policy} but this node "
        f"offers {weak}, so it receives nothing; make that subscriber {weak}, or start this node "
        f"with the parameter {override}:={offered}"
    )


def subscription_events(topic: str, report: Callable[[str], None]) -> SubscriptionEventCallbacks:
    """Return callbacks that pass a mismatch of QoS on ``topic`` to ``report``."""
    # The default callbacks wait for other events, which lengthens every wait of the executor.
    return SubscriptionEventCallbacks(
        incompatible_qos=partial(_report_mismatch, topic, report, True),
        use_default_callbacks=False,
    )


def publisher_events(topic: str, report: Callable[[str], None]) -> PublisherEventCallbacks:
    """Return callbacks that pass a mismatch of QoS on ``topic`` to ``report``."""
    return PublisherEventCallbacks(
        incompatible_qos=partial(_report_mismatch, topic, report, False),
        use_default_callbacks=False,
    )


def _report_mismatch(
    topic: str, report: Callable[[str], None], subscribing: bool, event: Any
) -> None:
    report(mismatch_text(topic, event.last_policy_kind, subscribing=subscribing))
