"""Options of single recordings, in files beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from cardbox_tracker.commands.main import build_parser
from cardbox_tracker.commands.recording_options import options_of
from cardbox_tracker.errors import CardboxError


def of_line(*words: str) -> object:
    return build_parser(["track"]).parse_args(["track", "in", *words])


def test_without_a_file_the_command_line_is_left(tmp_path: Path) -> None:
    line = of_line("--stature", "1.7")
    assert vars(options_of(line, tmp_path, "a/b")) == vars(line)


def test_files_change_the_command_line_and_inner_ones_the_outer(tmp_path: Path) -> None:
    (tmp_path / "anna").mkdir()
    (tmp_path / "anna.options").write_text("--stature 1.64 --start 3 # Anna is always late\n")
    (tmp_path / "anna" / "wave.options").write_text("--start 5\n--background 0:2")
    (tmp_path / "wave.options").write_text("--start 9")
    line = of_line("--stature", "1.7", "--effort", "2", "--silhouettes", "person_in_view")
    wave, bow = (options_of(line, tmp_path, f"anna/{name}") for name in ("wave", "bow"))
    assert (wave.stature, wave.start, wave.effort) == (1.64, 5.0, 2.0)
    assert (wave.background.start_s, wave.background.end_s, wave.silhouettes) == (0.0, 2.0, None)
    assert (bow.stature, bow.start, bow.background) == (1.64, 3.0, None)
    assert bow.silhouettes == "person_in_view"
    assert (line.stature, line.start) == (1.7, None)


def test_a_measured_person_takes_the_place_of_a_stature(tmp_path: Path) -> None:
    (tmp_path / "a.options").write_text("--model a.yaml --start 2 --detector points.csv")
    (tmp_path / "points.csv").touch()
    (tmp_path / "b.options").write_text("--detector mediapipe")
    line = of_line("--stature", "1.7", "--distance", "2", "--camera-pitch-deg", "5")
    found = options_of(line, tmp_path, "a")
    assert (found.stature, found.distance, found.camera_pitch_deg) == (None, None, None)
    # A path begins at the folder of its file.
    assert found.model == tmp_path / "a.yaml"
    assert found.detector == str(tmp_path / "points.csv")
    assert options_of(line, tmp_path, "b").detector == "mediapipe"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("--efort 2", "unrecognized arguments: --efort"),
        ("--csv out.csv", "unrecognized arguments: --csv"),
        ("--start soon", "got 'soon'"),
        ("--stature 1.7 --model a.yaml", "not allowed with"),
        ("--model 'a.yaml", "No closing quotation"),
    ],
)
def test_mistakes_name_the_file(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "a.options").write_text(text)
    with pytest.raises(CardboxError, match=expected) as caught:
        options_of(of_line(), tmp_path, "a")
    assert "a.options" in str(caught.value)
