"""'cardbox rula' on a recording: a table, a plot, times in words; and its mistakes."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest


def options(files: Path) -> tuple[object, ...]:
    inputs = (files / "session", "--background", "0:3.9", "--model", files / "person.yaml")
    return (*inputs, "--start", "20")


def test_a_recording_is_scored(files: Path, tmp_path: Path, cardbox: Callable) -> None:
    table, plot = tmp_path / "rula.csv", tmp_path / "rula.png"
    words = ("rula", *options(files), "--csv", table, "--arm-load", "3", "--trunk-twisted")
    done = cardbox(*words, "--plot", plot)
    assert done.code == 0, done.err
    assert "expected RULA score" in done.out
    assert f"wrote {plot}" in done.out
    assert plot.read_bytes().startswith(b"\x89PNG")
    with table.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["score"]]
    assert rows
    for row in rows:
        assert sum(float(row[f"chance_{i}"]) for i in range(1, 8)) == pytest.approx(1, abs=0.01)
        assert float(row["score"]) >= 3  # A of at least 1 and a load of 3: row 4 of table C
    first = table.read_bytes()
    assert cardbox(*words, "--force").code == 0
    assert table.read_bytes() == first


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--neck", "7"), "--neck is 7; expected 1 to 6"),
        (("--side-bent-deg", "90"), "--side-bent-deg is 90; expected 1 to 45"),
        (("--legs", "both"), "argument --legs: invalid int value: 'both'"),
        (("--plot", "FOLDER/missing/rula.png"), "No such file or directory"),
    ],
)
def test_mistakes_of_rula(
    files: Path, words: tuple[str, str], expected: str, cardbox: Callable
) -> None:
    given = [word.replace("FOLDER", str(files)) for word in words]
    done = cardbox("rula", *options(files), "--csv", files / "rula.csv", *given)
    done.assert_refused("rula", expected)
    assert not (files / "rula.csv").exists()
