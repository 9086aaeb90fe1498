"""After each fault the posture is right within a second, and no wrong one was published."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lab.tools.fault_nodes import InsideNodes
from lab.tools.fault_scene import FAULTS, START_NS, Found, Person, S, even, judge, run_of

PERSON = Person()


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[InsideNodes]:
    made = InsideNodes(PERSON, tmp_path)
    yield made
    made.close()


# The fault with 600 images takes long, and nothing has to keep up with it here.
QUICK = [name for name in FAULTS if name != "200 images a second"]


@pytest.mark.promise("After any fault or crash the posture is right within a second")
@pytest.mark.parametrize("fault", QUICK)
def test_tracking_goes_on_after_a_fault(nodes: InsideNodes, fault: str) -> None:
    sent = run_of(FAULTS[fault])
    for part in sent:
        nodes.send_all(part)
    verdict = judge(fault, PERSON, sent, nodes.found)
    assert verdict.is_good, verdict


@pytest.mark.promise("After any fault or crash the posture is right within a second")
def test_tracking_goes_on_after_both_nodes_were_killed(nodes: InsideNodes) -> None:
    sent = run_of(lambda images, _: [])
    nodes.send_all(sent[0])
    nodes.restart()
    nodes.send_all(sent[2])
    verdict = judge("killed", PERSON, sent, nodes.found)
    assert verdict.is_good, verdict


def test_the_truth_is_not_met_by_any_posture() -> None:
    sent = run_of(lambda images, _: [])
    still = [Found(i.stamp_ns, PERSON.posture(0.0)) for part in sent for i in part]
    assert not judge("a posture that never moves", PERSON, sent, still).is_good
    made_up = [Found(START_NS - S, PERSON.posture(0.0))]
    true = [Found(i.stamp_ns, PERSON.posture(i.at_s)) for part in sent for i in part]
    assert judge("the truth", PERSON, sent, true).is_good
    assert judge("made up", PERSON, sent, [*true, *made_up]).unseen == 1
    late = [f for f, i in zip(true, (i for part in sent for i in part), strict=True) if i.at_s < 4]
    assert judge("gone", PERSON, sent, late).resumed_s == np.inf
    assert len(even(0.0, 1.0)) == 15
