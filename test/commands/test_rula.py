"""'cardbox rula' on a recording: a table, a plot, times in words; and its mistakes."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from cardbox_tracker.commands import rula
from cardbox_tracker.common.errors import CardboxError


def options(files: Path) -> tuple[object, ...]:
    inputs = (files / "session", "--background", "0:3.9", "--model", files / "person.yaml")
    return (*inputs, "--start", "15.6")


@pytest.mark.parametrize("chosen", [(), ("--person", "2")])
def test_who_of_several_people_is_scored_is_told(
    chosen: tuple[str, ...], cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise CardboxError("stop")

    monkeypatch.setattr(rula, "tracking_request", lambda _: SimpleNamespace(inputs=()))
    monkeypatch.setattr(rula, "track", stop)
    done = cardbox("rula", "film.mp4", "--people", "2", *chosen)
    assert "stop" in done.err
    assert ("person 1 is scored; --person K gives another" in done.err) == (not chosen)


def test_a_recording_is_scored(files: Path, tmp_path: Path, cardbox: Callable) -> None:
    table, plot = tmp_path / "rula.csv", tmp_path / "rula.png"
    page = tmp_path / "rula.html"
    words = ("rula", *options(files), "--csv", table, "--arm-load", "3", "--trunk-twisted")
    pages = ("--html", page, "--title", "Packing")
    done = cardbox(*words, "--plot", plot, *pages)
    assert done.code == 0, done.err
    assert "expected RULA score" in done.out
    for path in (table, plot, page):
        assert f"wrote {path}" in done.out
    assert "declared, not seen: arm load 3, trunk twisted yes" in done.out
    assert plot.read_bytes().startswith(b"\x89PNG")
    with table.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["score"]]
    assert rows
    for row in rows:
        assert sum(float(row[f"chance_{i}"]) for i in range(1, 8)) == pytest.approx(1, abs=0.01)
        assert float(row["score"]) >= 3  # A of at least 1 and a load of 3: row 4 of table C
    text = page.read_text(encoding="utf-8")
    assert "<h1>Packing</h1>" in text
    assert sum(row["state"] == "tracking" for row in rows) >= 3
    assert "distance 2.00 m (from person.yaml)" in text
    assert "data:image/jpeg;base64," in text
    first = table.read_bytes()
    done = cardbox(*words, *pages, "--images", "none", "--force")
    assert done.code == 0, done.err
    assert table.read_bytes() == first
    assert "data:image/jpeg" not in page.read_text(encoding="utf-8")
    only = tmp_path / "only.html"
    done = cardbox("rula", *options(files), "--html", only, "--title", "Packing")
    assert done.code == 0, done.err
    assert [line for line in done.out.splitlines() if "wrote" in line] == [f"wrote {only}"]


def test_results_are_scored_as_their_recording(
    files: Path, tmp_path: Path, cardbox: Callable
) -> None:
    made = {name: tmp_path / name for name in ("film.csv", "bag", "a.csv", "b.csv", "c.csv")}
    files_of_track = ("--csv", made["film.csv"], "--bag", made["bag"])
    assert cardbox("track", *options(files), *files_of_track).code == 0
    assert cardbox("rula", *options(files), "--csv", made["a.csv"]).code == 0
    page = tmp_path / "page.html"
    done = cardbox("rula", made["film.csv"], "--csv", made["b.csv"], "--html", page)
    assert done.code == 0, done.err
    assert made["a.csv"].read_bytes() == made["b.csv"].read_bytes()
    assert "downward pitch" in page.read_text() and "data:image/jpeg" not in page.read_text()
    done = cardbox("rula", made["bag"], "--csv", made["c.csv"])
    assert done.code == 0, done.err
    lines = [csv.DictReader(made[name].read_text().splitlines()) for name in ("a.csv", "c.csv")]
    scores = [[row["likeliest"] for row in rows] for rows in lines]
    assert scores[0] == scores[1]
    (tmp_path / "film.body.yaml").unlink()
    done = cardbox("rula", made["film.csv"])
    done.assert_refused("rula", "no posture of a known person: keep OUT.body.yaml")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--neck", "7"), "--neck is 7; expected 1 to 6"),
        (("--wrist", "9"), "--wrist is 9; expected 1 to 4"),
        (("--legs", "both"), "argument --legs: invalid int value: 'both'"),
        (("--images", "none"), "give --html OUT.html"),
        (("--title", "Packing"), "give --html OUT.html"),
        (("--html", "FOLDER/rula.csv"), "is given for two outputs"),
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
