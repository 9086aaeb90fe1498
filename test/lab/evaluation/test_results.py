"""JSON files of results, and where they come from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cardbox_tracker.common.errors import CardboxError
from lab.evaluation.results import commit, processor, read_json, write_json


def test_numbers_are_rounded_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    write_json({"a": {"b": [1 / 3, 2]}, "c": None}, path)
    assert read_json(path) == {"a": {"b": [0.333333, 2]}, "c": None}


@pytest.mark.parametrize("text", ["{", "[1]", None])
def test_a_file_without_results_is_refused_by_its_name(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "results.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(CardboxError, match=r"results\.json"):
        read_json(path)


def test_the_commit_is_not_known_without_git(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*arguments: object, **options: object) -> None:
        raise FileNotFoundError("git")

    monkeypatch.setattr(subprocess, "run", missing)
    assert commit() is None


def test_a_processor_is_named() -> None:
    assert processor().strip()
