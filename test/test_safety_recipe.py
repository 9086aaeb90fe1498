"""The gate of docs/safety-slow-down.md stops the robot unless everything says otherwise."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from cardbox_tracker.tracking import tracker

DOCUMENT = Path(__file__).parents[1] / "docs" / "safety-slow-down.md"


@pytest.fixture(scope="module")
def gate() -> dict[str, Any]:
    (program,) = re.findall(r"(?ms)^```python\n(.*?)^```", DOCUMENT.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "gate"}
    exec(compile(program, str(DOCUMENT), "exec"), names)
    return names


def test_silence_of_either_is_a_stop(gate: dict[str, Any]) -> None:
    override, old_s = gate["override"], gate["OLD_S"]
    fresh = override(80, "tracking", "tracked", 0.0), override(80, "tracking", "tracked", old_s)
    assert fresh == (80, 80)
    assert override(80, "tracking", "tracked", 1.01 * old_s) == 0


@pytest.mark.parametrize(
    ("state", "place", "most"),
    [
        (tracker.TRACKING, "tracked", 100),
        (tracker.TRACKING, "uncertain", 20),
        (tracker.TRACKING, "", 20),
        (tracker.UNCERTAIN, "tracked", 20),
        (tracker.LOST, "tracked", 0),
        (tracker.NO_PERSON, "tracked", 0),
        ("", "tracked", 0),
    ],
)
def test_the_states_limit_what_is_asked_for(
    gate: dict[str, Any], state: str, place: str, most: int
) -> None:
    found = [gate["override"](asked, state, place, 0.0) for asked in (-5, 0, 10, 100, 300)]
    assert found == [0, 0, min(10, most), most, most]
