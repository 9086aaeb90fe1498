"""The table of what networks do for sources that they have not seen."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.errors import CardboxError
from learning import correction, left_out
from learning.samples import Samples

# Absolute, aligned and acceleration error without and with the correction, by clip.
FIGURES = {
    "a": (10.0, 6.0, 1.0, 8.0, 5.0, 1.0),
    "b": (12.0, 8.0, 1.0, 6.0, 9.0, 1.0),
    "c": (4.0, 4.0, 1.0, 2.0, 2.0, 1.0),
}


@pytest.fixture(autouse=True)
def figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(correction, "check", lambda _, one: FIGURES[one.origin.motion])


def test_a_row_has_the_means_of_each_way_of_tracking(make_samples: Any) -> None:
    each = [
        make_samples(motion="a"),
        make_samples(motion="b"),
        make_samples(motion="c", is_measured=True, has_points=True),
    ]
    assert [str(row) for row in left_out.rows_of("cmu-0", Any, each)] == [
        "| cmu-0 | measured, points | 1 | 4.0 / 2.0 | 4.0 / 2.0 | 4.0 / 2.0 | 100 % |",
        "| cmu-0 | unmeasured | 2 | 11.0 / 7.0 | 7.0 / 7.0 | 7.0 / 7.0 | 50 % |",
    ]


def test_no_network_is_judged_with_what_it_has_seen(
    monkeypatch: pytest.MonkeyPatch, make_samples: Any
) -> None:
    learned: list[list[Samples]] = []
    monkeypatch.setattr(correction, "learn", lambda some, **_: learned.append(list(some)))
    monkeypatch.setattr(left_out, "SOURCES", ("family=rocketbox", "source=scripted"))
    sources = ("makehuman", "cmu-07"), ("rocketbox", "cmu-07"), ("makehuman", "scripted")
    each = [make_samples(motion="a", family=family, source=source) for family, source in sources]
    session = make_samples(motion="c", family="real", source="film")
    rows = left_out.report(each, [session], 1)
    assert [row.left_out for row in rows] == ["rocketbox", "scripted", "real film"]
    # The package's network, which no session taught, is measured on sessions.
    assert learned == [[each[0], each[2]], [each[0], each[1]]]


def test_the_command_writes_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make_samples: Any
) -> None:
    monkeypatch.setattr(correction, "learn", lambda *_, **__: None)
    for number, family in enumerate(("makehuman", "rocketbox")):
        make_samples(motion="a", family=family).save(tmp_path / f"{number}.npz")
    output = tmp_path / "table.md"
    monkeypatch.setattr(left_out, "SOURCES", ("family=makehuman",))
    assert left_out.main([str(tmp_path), "--output", str(output)]) == 0
    assert output.read_text().splitlines()[-1].startswith("| makehuman | ")
    assert json.loads(output.with_suffix(".json").read_text())[0]["left_out"] == "makehuman"


def test_a_source_without_samples_is_found_before_the_first_training(
    monkeypatch: pytest.MonkeyPatch, make_samples: Any
) -> None:
    monkeypatch.setattr(correction, "learn", lambda *_, **__: pytest.fail("trained"))
    monkeypatch.setattr(left_out, "SOURCES", ("family=makehuman", "family=nobody"))
    each = [make_samples(family=family) for family in ("makehuman", "rocketbox")]
    with pytest.raises(CardboxError, match="family=nobody has 0 samples"):
        left_out.report(each, [], 1)
