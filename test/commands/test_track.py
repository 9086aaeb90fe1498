"""Mistakes of 'cardbox track': each is told in words, and nothing appears and nothing is lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--start", "-1"), "--start: expected seconds from the start of the recording, got '-1'"),
        (("--start", "soon"), "got 'soon'"),
        (("--start", "99"), "no image lies after --start 99 s"),
        (
            ("--background", "90:99"),
            "0 images lie in the background span 90:99 s of a",
        ),
        (("--preset", "fast"), "invalid choice: 'fast' (choose from "),
        (("--strategy", "best"), "invalid choice: 'best' (choose from "),
        (
            ("--refine-sizes", "1"),
            "--refine-sizes was removed: breadths stay as they were measured",
        ),
        (("--particles", "1"), "--particles: expected a whole number of 2 or more, got '1'"),
        (("--particles", "100"), "--particles has no effect with the filter whole_body"),
        (("--particles", "200"), "--particles has no effect with the filter whole_body"),
        (("--particles", "100"), "use --effort"),
        (("--strategy", "srs"), "use --effort"),
        (("--effort", "5"), "--effort is 5; expected 0.25 to 4"),
        (("--settings", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory; give a"),
        (("--settings", "FOLDER/list.yaml"), "list.yaml: expected names and values"),
        (("--settings", "FOLDER/person.yaml"), "person.yaml: 'format' is no setting; "),
        (("--seed", "-3"), "--seed: expected a whole number of 0 or more, got '-3'"),
        (("--model", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory; give the"),
        (("--model", "FOLDER/session"), "directory"),
        (("--model", "FOLDER/text.txt"), "text.txt"),
        (("--model", "FOLDER/binary.yaml"), "binary.yaml"),
        (("--model", "FOLDER/list.yaml"), "list.yaml"),
        (("--model", "FOLDER/lacking.yaml"), "head_width"),
        (("--model", "FOLDER/negative.yaml"), "head_width is -0.17 m; expected 0.08 to 0.35 m"),
        (("--model", "FOLDER/centimetres.yaml"), "(is it given in centimetres?)"),
        (("--csv", "FOLDER/missing/out.csv"), "out.csv: No such file or directory; choose"),
        (("--csv", "FOLDER/text.txt/out.csv"), "out.csv: Not a directory; choose a folder"),
        (("--csv", "FOLDER/empty folder"), "it is a folder; give the name of a file"),
        (("--video", "FOLDER/out.gif"), "its name must end in .mp4 or .avi"),
        (("--video", "FOLDER/missing/out.mp4"), "out.mp4: No such file or directory"),
        (("--bag", "FOLDER/session"), "session: it is read, as"),
        (("--csv", "FOLDER/session/session.mcap"), "session.mcap: it is read, as"),
        (("--csv", "FOLDER/person.yaml"), "person.yaml: it is read, as"),
        (("--csv", "FOLDER/text.txt"), "text.txt exists; choose another name, or give --force"),
        (("--bag", "FOLDER/out.csv"), "out.csv is given for two outputs"),
        (("--bag", "FOLDER/missing/out"), "No such file or directory; choose a folder"),
        (("--bag", "FOLDER/text.txt/out"), "Not a directory"),
    ],
)
def test_mistakes_of_track(
    files: Path, words: tuple[str, str], expected: str, cardbox: Callable
) -> None:
    before = sorted(path.name for path in files.iterdir())
    option, value = words
    options = {
        "--background": "0:3.9",
        "--model": f"{files / 'person.yaml'}",
        "--start": "15.6",
        "--csv": f"{files / 'out.csv'}",
    } | {option: value.replace("FOLDER", str(files))}
    done = cardbox("track", files / "session", *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused("track", expected)
    assert sorted(path.name for path in files.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--particles=9999999999",), "--particles is 1e+10; expected 2 to 1e+06"),
        (("--effort=0.5",), "--effort has no effect with the filter hierarchical (preset paper)"),
        (("--effort=1",), "--effort has no effect with the filter hierarchical (preset paper)"),
        (("--effort=0.5",), "use --particles"),
    ],
)
def test_settings_that_do_nothing_with_the_paper_preset(
    files: Path, words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    given = ("--background=0:3.9", f"--model={files / 'person.yaml'}", "--start=15.6")
    paper = (f"--csv={files / 'out.csv'}", "--preset=paper")
    done = cardbox("track", files / "session", *given, *paper, *words)
    done.assert_refused("track", expected)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "expected either --background T0:T1"),
        (("--background=0:3.9", "--within=2.5", "--depth=/depth"), "expected either --background"),
        (("--within=2.5",), "--within needs the topic of depth images: give --depth TOPIC"),
        (("--within=2.5", "--depth=stereo"), "--within needs the topic of depth images"),
        (("--within=2.5", "--depth=/depth"), "--depth needs --cameras"),
        (("--within=nan", "--depth=/d", "--cameras", "camera"), "the limit of the depth is nan m"),
        (("--within=2.5", "--depth=/d", "--cameras", "camera"), "has no topic /d; it has"),
    ],
)
def test_a_background_or_depth_tells_the_person_from_the_scene(
    files: Path, words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    given = (f"--model={files / 'person.yaml'}", "--start=15.6", f"--csv={files / 'out.csv'}")
    cardbox("track", files / "session", *given, *words).assert_refused("track", expected)
    assert not (files / "out.csv").exists()


@pytest.mark.parametrize("option", ["--detector", "--settings"])
def test_a_file_that_is_read_is_not_replaced(files: Path, option: str, cardbox: Callable) -> None:
    table = files / "text.txt"
    before = table.read_bytes()
    given = ("--background=0:3.9", f"--model={files / 'person.yaml'}", "--start=15.6", "--force")
    done = cardbox("track", files / "session", *given, f"{option}={table}", f"--csv={table}")
    done.assert_refused("track", "text.txt: it is read, as")
    assert table.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("missing", "there is no recording"),
        ("empty folder", "not a rosbag2 recording (it has no metadata.yaml)"),
        ("text.txt", "cannot read the recording"),
        ("person.yaml", "cannot read the recording"),
        ("no images", "has 0 image topics; expected one"),
        ("no camera_info", "has 0 CameraInfo topics; expected one"),
        ("cut.mcap", "cut.mcap"),
    ],
)
@pytest.mark.parametrize("command", ["initialize", "track"])
def test_recordings_that_are_none(
    files: Path, command: str, name: str, expected: str, spans: dict[str, str], cardbox: Callable
) -> None:
    output = files / "output"
    if command == "initialize":
        options = spans | {"--distance": "2", "--output": f"{output}"}
    else:
        options = {
            "--background": "0:3.9",
            "--model": f"{files / 'person.yaml'}",
            "--start": "1",
            "--csv": f"{output}",
        }
    done = cardbox(command, files / name, *(f"{n}={text}" for n, text in options.items()))
    done.assert_refused(command, expected, name)
    assert not output.exists()
