"""Long runs in short: what they record, and the page about it."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import pytest

from lab.evaluation.results import read_json
from lab.tools.endurance import main
from lab.tools.endurance_record import Record, Resources, resources_of, section_of


def test_a_short_day_is_recorded_with_its_page(tmp_path: Path) -> None:
    """The person is there for the first forty of each fifty seconds, at 30 Hz."""
    image = tmp_path / "endurance.png"
    given = ["day", "--images", "1300", "--output", str(tmp_path), "--image", str(image)]
    assert main(given) == 0
    data = read_json(tmp_path / "endurance-day.json")
    counts = data["counts"]
    assert counts["images with the person"] == 1200
    assert counts["images of an empty room"] == 100
    assert counts["of these with a posture"] == 0
    assert (counts["times the person came"], counts["times tracked a second later"]) == (1, 1)
    assert image.read_bytes().startswith(b"\x89PNG")
    assert "1,300 images" in (tmp_path / "endurance.md").read_text(encoding="utf-8")


def test_the_first_quarter_is_compared_with_the_last(tmp_path: Path) -> None:
    record = Record(tmp_path / "run.json", "hour", "A run.", 90.0, "s", Counter(sent=40))
    for number in range(9):
        used = {"core": Resources(100.0 + 10 * number, 5, 4 + number // 8)}
        record.add(10.0 * number, 5 * number, [0.001 * number] * 3, used, error_cm=None)
    text = section_of(read_json(tmp_path / "run.json"))
    # The first sample is left out: samples 1 and 2, 7 and 8 remain.
    assert "| core | 115.0, 175.0 | 5, 5 | 4, 5 |" in text
    assert "| latency, median, ms | 1.5 | 7.5 |" in text
    assert "40 images in 1 minutes, of 90 s wanted" in text
    assert "- sent: 40" in text


def test_the_resources_are_those_of_the_process() -> None:
    before = resources_of(os.getpid())
    with open(os.devnull, encoding="utf-8"):
        assert resources_of(os.getpid()).files == before.files + 1
    assert before.memory_mb > 10
    with pytest.raises(OSError):
        resources_of(2**30)
