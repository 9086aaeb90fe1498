"""``cardbox body`` writes a body that ``cardbox track`` can follow somebody with at once."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.body.model_file import load_body_model


def test_somebody_is_tracked_without_reference_postures(
    cardbox: Callable[..., Any], files: Path, tmp_path: Path
) -> None:
    model, table = tmp_path / "me.yaml", tmp_path / "me.csv"
    done = cardbox("body", "--stature", 1.72, "--distance", 2, "--output", model)
    assert done.code == 0, done.err
    assert "not measured" in done.out
    assert load_body_model(model).source == "proportions"
    given = ("--background", "0:3.9", "--start", 15.6, "--csv", table)
    done = cardbox("track", files / "session", "--model", model, *given)
    assert done.code == 0, done.err
    assert "me.yaml: sizes from the proportions" in done.out
    with table.open(encoding="utf-8") as file:
        states = [row["state"] for row in csv.DictReader(file)]
    assert states.count("tracking") > 0.8 * len(states)


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("--stature", 180), "stature is 180 m; expected 1.1 to 2.2 m (is it given in centimetres"),
        (("--stature", 1.8, "--distance", 0.1), "distance_m is 0.1 m"),
        (("--stature", 1.8, "--shoulder-breadth", 38), "shoulder_breadth is 38 m"),
    ],
)
def test_impossible_numbers_are_refused(
    cardbox: Callable[..., Any], tmp_path: Path, words: tuple[object, ...], text: str
) -> None:
    done = cardbox("body", *words, "--output", tmp_path / "me.yaml")
    done.assert_refused("body", text)
    assert not (tmp_path / "me.yaml").exists()


def test_a_model_that_exists_is_kept_without_force(
    cardbox: Callable[..., Any], tmp_path: Path
) -> None:
    model = tmp_path / "me.yaml"
    words = ("body", "--stature", 1.8, "--output", model)
    assert cardbox(*words).code == 0
    written = model.read_bytes()
    cardbox(*words[:2], 1.7, *words[3:]).assert_refused("body", "me.yaml exists")
    assert model.read_bytes() == written
    assert cardbox(*words, "--force").code == 0
