"""The text about a mismatch of QoS has the cause and the remedy."""

from __future__ import annotations

from copy import copy

import pytest
from rclpy.qos import DurabilityPolicy, QoSPolicyKind

from cardbox_tracker.ros.runtime import qos


@pytest.mark.parametrize(
    ("kind", "subscribing", "words"),
    [
        (
            QoSPolicyKind.RELIABILITY,
            True,
            ("best effort", "nothing arrives", "qos_overrides./image.subscription.reliability"),
        ),
        (
            QoSPolicyKind.RELIABILITY,
            False,
            ("receives nothing", "qos_overrides./image.publisher.reliability:=reliable"),
        ),
        (QoSPolicyKind.DURABILITY, True, ("latched", "durability:=volatile")),
    ],
)
def test_mismatch_names_topic_cause_and_remedy(
    kind: QoSPolicyKind, subscribing: bool, words: tuple[str, ...]
) -> None:
    text = qos.mismatch_text("/image", kind, subscribing=subscribing)
    for word in ("incompatible QoS on /image", *words):
        assert word in text


def test_durability_of_latched_topics_stays_latched() -> None:
    assert QoSPolicyKind.DURABILITY in qos.overridable(qos.RESULT).policy_kinds
    assert QoSPolicyKind.DURABILITY not in qos.overridable(qos.LATCHED).policy_kinds


def test_a_copy_can_be_overridden_without_changing_the_profile() -> None:
    changed = copy(qos.LATCHED)
    changed.durability = DurabilityPolicy.VOLATILE
    assert qos.LATCHED.durability == DurabilityPolicy.TRANSIENT_LOCAL
