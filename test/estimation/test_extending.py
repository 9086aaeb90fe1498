"""The worked example of docs/extending.md is executed as it stands there."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.terms import ARMS, Frame
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.vision.rasterisation import render

ROOT = Path(__file__).parents[2]
CODE = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "extending.md").read_text(), re.DOTALL)


@pytest.fixture
def table(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The example's file as a module of its name."""
    module = ModuleType("table")
    monkeypatch.setitem(sys.modules, "table", module)
    monkeypatch.chdir(ROOT)
    exec(compile(CODE[0], "table.py", "exec"), vars(module))
    yield module


@pytest.fixture
def tracker(table: ModuleType) -> Tracker:
    """What the example's second piece makes."""
    names: dict[str, Any] = {}
    exec(CODE[1], names)
    return names["tracker"]


def test_the_term_rates_by_hand(table: ModuleType, tracker: Tracker) -> None:
    body = tracker.body
    frame = Frame(np.zeros((240, 320), np.uint8), 200, 0)
    hanging = np.zeros((1, 12))
    hand_m = forward_kinematics(body, hanging[0]).left.hand[2]
    seen = table.Table(top_m=hand_m + 0.05).build(body, tracker.camera).observe(frame)
    # Both hands are 5 cm too low: 2000 px a metre each.
    assert seen.postures(hanging).tolist() == pytest.approx([200.0])
    rate = seen.arms_beside(np.zeros(4))
    for side in ARMS:
        assert rate(side, np.zeros((2, 4))).tolist() == pytest.approx([100.0, 100.0])
    assert seen.torsos_beside(None)(np.zeros((3, 4))).tolist() == [0, 0, 0]


def test_the_tracker_uses_the_term(table: ModuleType, tracker: Tracker) -> None:
    """With a weight above that of the silhouette, hands rise to the table's top."""
    assert isinstance(tracker.config.terms[-1], table.Table)
    heavy = table.Table(top_m=-0.1, weight_px_per_m=50_000.0)
    tracker.configure(replace(tracker.config, terms=(heavy,)))
    posture = reference_posture("front")
    silhouette = render(cardbox_patches(tracker.body, posture), tracker.camera)
    without = Tracker(tracker.body, tracker.camera)
    found = []
    for of in (without, tracker):
        estimates = [of.track(silhouette) for _ in range(8)]
        assert estimates[-1].posture is not None
        frames = forward_kinematics(of.body, estimates[-1].posture)
        found.append((frames.left.hand[2] + frames.right.hand[2]) / 2)
    assert found[0] < -0.3 < -0.15 < found[1]
