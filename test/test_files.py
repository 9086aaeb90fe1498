"""Files appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import atomic_path


def test_a_file_appears_when_all_went_well(tmp_path: Path) -> None:
    target = tmp_path / "person.csv"
    with atomic_path(target) as path:
        path.write_text("half")
        assert not target.exists()
        path.write_text("whole")
    assert target.read_text() == "whole"
    assert os.listdir(tmp_path) == ["person.csv"]


def test_the_temporary_file_lies_beside_it_with_its_ending(tmp_path: Path) -> None:
    # Renaming works within one file system only, and encoders go by the ending.
    with atomic_path(tmp_path / "overlay.mp4") as path:
        assert (path.parent, path.suffix) == (tmp_path, ".mp4")
        assert path.name.startswith(".")


def test_an_older_file_is_replaced(tmp_path: Path) -> None:
    target = tmp_path / "person.csv"
    target.write_text("old")
    with atomic_path(str(target)) as path:
        path.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"


def test_after_an_error_the_older_file_is_left_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "person.csv"
    target.write_text("old")
    with pytest.raises(RuntimeError, match="half way"), atomic_path(target) as path:
        path.write_text("new")
        raise RuntimeError("half way")
    assert target.read_text() == "old"
    assert os.listdir(tmp_path) == ["person.csv"]


def test_a_writer_that_replaced_the_temporary_file_is_fine(tmp_path: Path) -> None:
    target = tmp_path / "plot.png"
    with atomic_path(target) as path:
        path.unlink()
        path.write_bytes(b"png")
    assert target.read_bytes() == b"png"


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "missing" / "person.csv"
    with (
        pytest.raises(CardboxError, match=r"cannot write .*person.csv: No such file .*; choose a"),
        atomic_path(target),
    ):
        pytest.fail("there is nothing to write to")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with (
        pytest.raises(CardboxError, match="Permission denied; choose a folder"),
        atomic_path(tmp_path / "person.csv"),
    ):
        pytest.fail("there is nothing to write to")


@pytest.mark.parametrize("name", ["", ".", "folder"])
def test_a_folder_in_place_of_a_file_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with (
        pytest.raises(CardboxError, match="it is a folder; give the name of a file"),
        atomic_path(name),
    ):
        pytest.fail("there is nothing to write to")
    assert os.listdir(tmp_path) == ["folder"]
