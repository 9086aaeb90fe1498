"""'cardbox demo' tracks the film inside the package, without ROS, detector or network."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.demo.film import DemoFilm


def test_the_demo_tracks_its_film_and_says_the_error(
    tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    for missing in ("rclpy", "ai_edge_litert"):
        monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "nothing is installed"))
    output = tmp_path / "out"
    done = cardbox("demo", "--output", output)
    assert done.code == 0, done.err
    figures = json.loads((output / "report.json").read_text())
    assert (figures["images"], figures["images_compared"]) == (171, 141)
    # Errors of the model are far above; those of a mirrored or turned skeleton are above 20 cm.
    assert 0.03 < figures["shape_error_m"] < figures["mediapipe_shape_error_m"] < 0.12
    assert figures["shape_error_m"] < figures["mediapipe_turned_error_m"] < 0.08
    assert figures["shape_error_m"] < figures["place_error_m"] < 0.2
    assert f"{100 * figures['shape_error_m']:.1f} cm beside the middle" in done.out
    assert "CC0 1.0" in done.out
    for name in ("space.png", "error.png"):
        picture = cv2.imread(str(output / name))
        assert picture.std() > 10.0, f"{name} is empty"
    reader = cv2.VideoCapture(str(output / "overlay.mp4"))
    assert int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) == 171
    assert (output / "angles.trc").read_text().startswith("PathFileType\t4")
    with (output / "angles.csv").open() as file:
        assert sum(row["state"] != "no_person" for row in csv.DictReader(file)) == 171


def test_options_of_the_nodes_need_live(tmp_path: Path, cardbox: Callable) -> None:
    for words in (("--cameras", 2), ("--preset", "paper")):
        cardbox("demo", "--output", tmp_path / "out", *words).assert_refused("demo", "give --live")
    assert not (tmp_path / "out").exists()


def test_the_film_is_small_h264_and_belongs_to_its_data() -> None:
    film = DemoFilm.load()
    assert film.path.stat().st_size < 400_000
    assert b"avc1" in film.path.read_bytes()
    images = cv2.VideoCapture(str(film.path))
    assert int(images.get(cv2.CAP_PROP_FRAME_COUNT)) == len(film.found) == len(film.true_m)
    assert film.found[0].mask.shape == (240, 320)


def test_errors_of_the_demo_are_those_computed_by_hand() -> None:
    film = DemoFilm.load()
    number = int(np.flatnonzero(np.isfinite(film.true_m).all(axis=(1, 2)))[0])
    moved = film.true_m + np.array([0.3, 0.0, 0.4])
    assert film.errors_m(moved)[number] == pytest.approx(0.0, abs=1e-9)
    assert film.errors_m(moved, is_placed=True)[number] == pytest.approx(0.5)
    # One hand of six joints is 6 cm off, so the mean is 1 cm.
    moved[:, 2, 1] += 0.06
    assert film.errors_m(moved)[number] == pytest.approx(0.01)
