"""Public films are fetched from their repositories, and judged moments are counted by state."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.result_reader import Results
from lab.tools.public_films import HEADER, LIST, MOMENTS, figures, get, moments, sheet


def git(folder: Path, *arguments: str) -> str:
    identity = "-c", "user.name=a", "-c", "user.email=a@b.c"
    done = subprocess.run(
        ["git", "-C", str(folder), *identity, *arguments], capture_output=True, check=True
    )
    return done.stdout.decode().strip()


def test_one_file_of_a_commit_is_fetched(tmp_path: Path) -> None:
    there = tmp_path / "from" / "owner" / "name"
    there.mkdir(parents=True)
    git(there, "init", "--quiet")
    (there / "walk.mp4").write_bytes(b"first")
    git(there, "add", ".")
    git(there, "commit", "--quiet", "-m", "one")
    film = {"name": "walk", "repository": "owner/name", "path": "walk.mp4"}
    film["commit"] = git(there, "rev-parse", "HEAD")
    (there / "walk.mp4").write_bytes(b"second")
    git(there, "commit", "--quiet", "-am", "two")
    git(there, "config", "uploadpack.allowAnySHA1InWant", "true")
    path = tmp_path / "walk.mp4"
    get(film, path, (tmp_path / "from").as_uri())
    assert path.read_bytes() == b"first"
    with pytest.raises(CardboxError, match=r"walk does not come from .*owner/name"):
        get({**film, "path": "other.mp4"}, path, (tmp_path / "from").as_uri())


def results(states: list[str], place: list[str]) -> Results:
    count = len(states)
    texts = {"place_state": tuple(place), "vertical_state": ("tracked",) * count}
    for side in ("left", "right"):
        texts[f"{side}_hand_state"] = ("tracked", "hidden") * (count // 2)
    times = np.arange(count)
    return Results(Path("a.csv"), times, times / 10, tuple(states), {}, texts, (None,) * count)


def test_moments_are_even_and_their_verdicts_are_counted_by_state() -> None:
    assert moments(80) == [5, 15, 25, 35, 45, 55, 65, 75]
    # Sure is the first half of the film, and the place in the second.
    one = results(["tracking"] * 8 + ["uncertain"] * 8, ["uncertain"] * 8 + ["tracked"] * 8)
    film = {"name": "a", "kind": "walk", "shape": "+-++-+??", "distance": "+-++-+--"}
    cells = dict(zip(HEADER, figures(film, one), strict=True))
    assert cells["images"] == 16
    assert [cells[name] for name in ("shape", "vertical", "distance", "hands")] == [
        *("50%", "100%", "50%", "50%")
    ]
    assert cells["right shape and sure"] == "3 of 4" and cells["wrong shape and sure"] == "1 of 2"
    assert cells["right distance and sure"] == "1 of 4"
    assert cells["wrong distance and sure"] == "3 of 4"


def test_a_sheet_has_all_moments(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    with video_file(path, 10.0) as add:
        for number in range(16):
            add(np.full((48, 84, 3), 10 * number, np.uint8))
    picture = sheet(path, results(["tracking"] * 16, ["tracked"] * 16))
    rows = [picture[100 + picture.shape[0] // 2 * row] for row in range(2)]
    tiles = [row[420 * at + 100 : 420 * at + 300] for row in rows for at in range(4)]
    greys = [tile.mean() for tile in tiles]
    np.testing.assert_allclose(greys, [10 * number for number in moments(16)], atol=6)


def test_each_film_has_an_origin_a_licence_and_verdicts() -> None:
    with LIST.open(encoding="utf-8", newline="") as file:
        films = list(csv.DictReader(file))
    assert len({film["name"] for film in films}) == len(films) >= 15
    for film in films:
        assert film["repository"].count("/") == 1 and len(film["commit"]) == 40
        assert film["licence"] and film["path"] and film["kind"]
        for name in ("shape", "distance"):
            assert len(film[name]) == MOMENTS and set(film[name]) <= set("+-?")
