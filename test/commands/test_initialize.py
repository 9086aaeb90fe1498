"""Mistakes of 'cardbox initialize': each is told in words, and nothing appears."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

SPAN = "expected T0:T1, seconds from the start of the recording"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        *((("--" + name, "9:3"), f"--{name}: {SPAN}") for name in ("front", "side", "arms")),
        (("--background", "5"), f"--background: {SPAN}"),
        (("--depth", "/depth"), "--depth and --distance"),
        (("--distance", "far"), "invalid float value: 'far'"),
        (("--distance", "-2"), "distance_m is -2 m; expected 0.3 to 20 m"),
        (("--distance", "0"), "distance_m is 0 m; expected 0.3 to 20 m"),
        (("--distance", "nan"), "distance_m is nan; expected a finite number of m"),
        (("--distance", "200"), "distance_m is 200 m; expected 0.3 to 20 m"),
        (("--camera-pitch-deg", "95"), "camera_pitch_rad is 1.65806 rad; expected -1.4 to 1.4 rad"),
        (("--side-turn", "back"), "invalid choice: 'back' (choose from "),
        (("--seed", "-1"), "--seed: expected a whole number of 0 or more, got '-1'"),
        (("--front", "90:99"), "no image lies in the front span 90:99 s of a recording of"),
        (("--front", "0:3"), "reference 'front': nobody is in the image"),
        (("--side", "6.6:8"), "'front' and 'side' are too alike"),
        (("--output", "FOLDER/text.txt"), "text.txt exists; choose another name, or give"),
        (("--output", "FOLDER/session/session.mcap"), "session.mcap: it is read, as"),
        (("--output", "FOLDER/missing/new.yaml"), "No such file or directory; choose a folder"),
        (("--output", "FOLDER/text.txt/new.yaml"), "Not a directory; choose a folder"),
        (("--output", "FOLDER/empty folder"), "it is a folder; give the name of a file"),
    ],
)
def test_mistakes_of_initialize(
    files: Path, words: tuple[str, str], expected: str, spans: dict[str, str], cardbox: Callable
) -> None:
    before = sorted(path.name for path in files.iterdir())
    option, value = words
    options = spans | {"--distance": "2", "--output": f"{files / 'new.yaml'}"}
    options[option] = value.replace("FOLDER", str(files))
    done = cardbox("initialize", files / "session", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", expected)
    assert sorted(path.name for path in files.iterdir()) == before


def test_references_taken_for_each_other_are_named(
    files: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    options = spans | {"--distance": "2", "--output": f"{files / 'new.yaml'}"}
    options["--front"], options["--side"] = spans["--side"], spans["--front"]
    done = cardbox("initialize", files / "session", *(f"{n}={text}" for n, text in options.items()))
    expected = "references 'front' and 'side' look swapped; capture both again"
    done.assert_refused("initialize", expected)
    assert not (files / "new.yaml").exists()


def test_a_missing_output_folder_is_told_before_the_recording_is_read(
    tmp_path: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    options = spans | {"--distance": "2", "--output": f"{tmp_path / 'none' / 'body.yaml'}"}
    done = cardbox("initialize", "no_bag", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", "No such file or directory; choose a folder")


def test_one_camera_needs_the_distance(
    tmp_path: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    options = spans | {"--output": f"{tmp_path / 'body.yaml'}", "--cameras": "left"}
    done = cardbox("initialize", "no_bag", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("initialize", "give --distance M, --depth TOPIC, or two --cameras")
