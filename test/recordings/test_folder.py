"""The recordings of a folder: which paths are some, and their names."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.open_images import SUMMARY, is_one_recording, recordings_in


def make(folder: Path, *names: str) -> None:
    """Make empty files; their content does not count."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("metadata.yaml", "a_0.mcap", "a_1.mcap"), True),
        (("bag/metadata.yaml", "bag/bag.mcap", "background.png"), True),
        (("a.mcap",), True),
        (("a.mcap", "b.mcap"), False),
        (("1.JPG", "2.JPG", "masks/1.png"), True),
        (("1.jpg", "preview.mp4"), True),
        (("plan.png", "a/bag/metadata.yaml"), False),
        (("a.mp4",), False),
        (("README.md",), False),
    ],
)
def test_a_folder_is_one_recording_or_many(
    tmp_path: Path, names: tuple[str, ...], expected: bool
) -> None:
    make(tmp_path, *names)
    assert is_one_recording(tmp_path) is expected


def test_a_file_is_one_recording(tmp_path: Path) -> None:
    assert is_one_recording(tmp_path / "missing.mp4")


def test_recordings_are_named_by_their_place(tmp_path: Path) -> None:
    make(tmp_path, "b/bag/metadata.yaml", "a/film.MP4", "a/photos/1.png", "c_0.mcap", "d.db3")
    make(tmp_path, "README.md", "notes.txt", "a/film.options", "person.yaml", "empty/.keep")
    found = recordings_in(tmp_path)
    assert list(found) == ["a/film", "a/photos", "b", "c_0", "d"]
    assert found["a/film"] == tmp_path / "a" / "film.MP4"
    assert found["b"] == tmp_path / "b"


def test_equal_names_keep_their_endings(tmp_path: Path) -> None:
    make(tmp_path, "film.mp4", "film.mov", "walk.mp4", "walk/metadata.yaml")
    assert list(recordings_in(tmp_path)) == ["film.mov", "film.mp4", "walk", "walk.mp4"]


def test_names_that_an_ending_would_make_equal_differ(tmp_path: Path) -> None:
    make(tmp_path, "film.mp4", "film.mov", "film.mp4.avi")
    found = recordings_in(tmp_path)
    assert len(found) == 3
    assert set(found.values()) == set(tmp_path.iterdir())


def test_results_hidden_entries_and_linked_folders_are_left_out(tmp_path: Path) -> None:
    make(tmp_path, "in/a.mp4", "in/.cache/b.mp4", "in/.c.mp4", f"in/old/{SUMMARY}", "in/old/a.mp4")
    make(tmp_path, "in/new/a.mp4", "far/d.mp4", "session/metadata.yaml")
    (tmp_path / "in" / "link").symlink_to(tmp_path / "far")
    (tmp_path / "in" / "linked").symlink_to(tmp_path / "session")
    (tmp_path / "in" / "circle").symlink_to(tmp_path / "in")
    assert list(recordings_in(tmp_path / "in", tmp_path / "in" / "new")) == ["a", "linked"]


def test_folders_that_are_nested_too_deep_are_refused(tmp_path: Path) -> None:
    (tmp_path / "/".join("d" * 60)).mkdir(parents=True)
    with pytest.raises(CardboxError, match="more than 50 folders deep"):
        recordings_in(tmp_path)
    (tmp_path / "d").rename(tmp_path / ".d")
    make(tmp_path, "/".join("d" * 49) + "/a.mp4")
    assert list(recordings_in(tmp_path)) == ["/".join("d" * 49) + "/a"]


def test_names_are_shown_as_tables_terminals_and_spreadsheets_can_show_them(tmp_path: Path) -> None:
    names = ["a", "=1+1", "-b", "new\nline", "\x1b[2J"]
    for name in names:
        make(tmp_path, f"{name}.mp4")
    found = recordings_in(tmp_path)
    assert {"a", "./=1+1", "./-b", r"new\nline", r"\x1b[2J"} == set(found)
    assert {path.stem for path in found.values()} == set(names)


def test_a_name_that_is_not_utf_8_does_not_refuse_the_folder(tmp_path: Path) -> None:
    make(tmp_path, "a.mp4")
    bad = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.mp4"))
    try:
        bad.touch()
    except OSError:
        pytest.skip("this file system has UTF-8 names only")
    found = recordings_in(tmp_path)
    assert found == {"a": tmp_path / "a.mp4", r"\udcff": bad}
    assert all(name.encode() for name in found)


def test_a_folder_that_cannot_be_read_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make(tmp_path, "a/b.txt")
    scan = os.scandir

    def refusing(path: Path) -> object:
        if Path(path).name == "a":
            raise PermissionError(13, "Permission denied")
        return scan(path)

    monkeypatch.setattr(os, "scandir", refusing)
    with pytest.raises(CardboxError, match="a: Permission denied"):
        recordings_in(tmp_path)
