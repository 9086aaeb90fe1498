"""'cardbox reba' on a table of results: its files, and its mistakes."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.result_table import row_of, units
from cardbox_tracker.tracking.estimate import Estimate, Legs


@pytest.fixture
def results(tmp_path: Path) -> Path:
    points_m = np.arange(18.0).reshape(6, 3) / 20
    states = (KeypointState.TRACKED,) * 6
    legs = Legs(np.zeros(8), np.full(8, 0.05), points_m, np.full(6, 0.05), states)
    arms = np.zeros(12), np.full(12, 0.02), np.zeros((6, 3))
    path = tmp_path / "film.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(units(has_points=True, has_people=True))
        for number in range(10):
            found = Estimate("tracking", *arms, 100, 0.9, person=1, legs=legs)
            row = row_of(10**8 * number, number / 10, found, has_points=True, has_people=True)
            writer.writerow(["" if cell is None else cell for cell in row])
    return path


def test_a_table_is_scored(results: Path, tmp_path: Path, cardbox: Callable) -> None:
    table, plot, page = (tmp_path / f"reba.{end}" for end in ("csv", "png", "html"))
    words = ("reba", results, "--csv", table, "--load", "2", "--plot", plot)
    done = cardbox(*words, "--html", page, "--title", "Lifting")
    assert done.code == 0, done.err
    assert "expected REBA score" in done.out
    assert "declared, not seen: load 2" in done.out
    with table.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 10 and {row["legs_from"] for row in rows} == {"measured"}
    for row in rows:
        assert sum(float(row[f"chance_{i}"]) for i in range(1, 16)) == pytest.approx(1, abs=0.01)
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert "<h1>Lifting</h1>" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--coupling", "4"), "--coupling is 4; expected 0 to 3"),
        (("--person", "2"), "has no person 2"),
        (("--csv", "RESULTS"), "it is read, as"),
    ],
)
def test_mistakes_of_reba(
    results: Path, words: tuple[str, str], expected: str, cardbox: Callable
) -> None:
    given = [word.replace("RESULTS", str(results)) for word in words]
    cardbox("reba", results, *given).assert_refused("reba", expected)
