"""The files of an evaluation."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.evaluation.paper.results import (
    commit,
    motions_in,
    processor,
    read_json,
    write_curves,
    write_json,
)


def test_numbers_are_rounded_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    write_json({"a": {"b": [1 / 3, 2]}, "c": None}, path)
    assert read_json(path) == {"a": {"b": [0.333333, 2]}, "c": None}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", r"results\.json .*JSON"),
        ("[1]", r"results\.json .*no results"),
        (None, r"results\.json: No such"),
    ],
)
def test_what_is_no_result_is_refused(tmp_path: Path, text: str | None, words: str) -> None:
    path = tmp_path / "results.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(CardboxError, match=words):
        read_json(path)


def test_motions_are_the_keys_with_both_strategies() -> None:
    results = {
        "wave": {"drs": {}, "srs": {}},
        "experiments": {"particles": {}},
        "seed": 0,
        "reach": {"drs": {}, "srs": {}},
    }
    assert motions_in(results) == ["wave", "reach"]


def test_curves_have_a_row_an_image(tmp_path: Path) -> None:
    path = tmp_path / "per_frame.csv"
    columns = {"time_s": np.array([0.0, 0.5]), "cost_px": np.array([10.0, 1 / 3])}
    write_curves({("wave", "drs"): columns, ("wave", "srs"): columns}, path)
    assert path.read_text().splitlines() == [
        "motion,strategy,time_s,cost_px",
        "wave,drs,0,10",
        "wave,drs,0.5,0.33333",
        "wave,srs,0,10",
        "wave,srs,0.5,0.33333",
    ]


def test_the_commit_is_not_known_without_git(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*arguments: object, **options: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert commit() is None


def test_a_processor_is_named() -> None:
    assert json.dumps(processor())
    assert processor().strip()
