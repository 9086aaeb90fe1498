"""'cardbox reba' on a table of results: its files, and its mistakes."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands import rula
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.result_table import row_of, units
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import Observer
from cardbox_tracker.tracking.estimate import Estimate, Legs
from cardbox_tracker.tracking.tracker import Tracker


def seen(person: int | None = None) -> Estimate:
    points_m = np.arange(18.0).reshape(6, 3) / 20
    states = (KeypointState.TRACKED,) * 6
    legs = Legs(np.zeros(8), np.full(8, 0.05), points_m, np.full(6, 0.05), states)
    arms = np.zeros(12), np.full(12, 0.02), np.zeros((6, 3))
    return Estimate("tracking", *arms, 100, 0.9, person=person, legs=legs)


@pytest.fixture
def results(tmp_path: Path) -> Path:
    path = tmp_path / "film.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(units(has_points=True, has_people=True))
        for number in range(10):
            row = row_of(10**8 * number, number / 10, seen(1), has_points=True, has_people=True)
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


def test_a_film_is_scored_as_its_table_and_its_page_has_images_and_camera(
    results: Path, tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracker = Tracker(
        body_from_proportions(1.75, 2.0), Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
    )

    def track(_: object, observers: tuple[Observer, ...]) -> SimpleNamespace:
        grey = np.full((240, 320), 128, np.uint8)
        for number in range(10):
            observers[0](RecordedFrame(10**8 * number, number / 10, grey, grey), seen(), tracker)
        return SimpleNamespace(body=tracker.body, assumptions=("downward pitch 3 degrees",))

    monkeypatch.setattr(rula, "tracking_request", lambda _: SimpleNamespace(inputs=()))
    monkeypatch.setattr(rula, "track", track)
    page, of_film, of_table = (tmp_path / name for name in ("a.html", "a.csv", "b.csv"))
    words = ("reba", "film.mp4", "--detector", "mediapipe", "--load", "1", "--csv", of_film)
    done = cardbox(*words, "--html", page)
    assert done.code == 0, done.err
    text = page.read_text(encoding="utf-8")
    assert "data:image/jpeg;base64," in text and "downward pitch 3 degrees" in text
    assert cardbox("reba", results, "--load", "1", "--csv", of_table).code == 0
    assert of_film.read_bytes() == of_table.read_bytes()
    cardbox("reba", "film.mp4").assert_refused("reba", "needs legs", "--detector mediapipe")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--fov", "60"), "--fov has no effect on"),
        (("--person", "left"), "--person, but for a number, has no effect on"),
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
