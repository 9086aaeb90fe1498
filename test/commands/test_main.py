"""The cardbox command: help for everything, and each mistake told in words, without a traceback."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker import __version__
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import load_body_model, save_body_model
from cardbox_tracker.commands.main import build_parser, main
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.simulation.session import synthesize_session

COMMANDS = sorted(
    name
    for action in build_parser()._actions
    if isinstance(action.choices, dict)
    for name in action.choices
)
BACKGROUND = ("--background", "0:3.9")
SPANS = (*BACKGROUND, "--front", "6.6:8", "--side", "9.6:11", "--arms", "12.6:14")


def run(*words: object) -> int:
    """Run cardbox; return its exit code, also where argparse ends it."""
    try:
        return main([str(word) for word in words])
    except SystemExit as end:
        assert isinstance(end.code, int)
        return end.code


@dataclass(frozen=True)
class Files:
    """Good files and bad ones, in one folder."""

    folder: Path

    def __truediv__(self, name: str) -> Path:
        return self.folder / name


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    folder = tmp_path_factory.mktemp("cli")
    synthesize_session(folder / "session", "bow", fps=4.0, width=160, height=120)
    save_body_model(BodyModel.of(hip_height_m=-0.51), folder / "person.yaml")
    text = (folder / "person.yaml").read_text()
    (folder / "text.txt").write_text("no recording, no model\n")
    (folder / "binary.yaml").write_bytes(bytes(range(256)))
    (folder / "list.yaml").write_text("- 1\n- 2\n")
    (folder / "broken.yaml").write_text("sizes: [1, 2\n")
    (folder / "negative.yaml").write_text(replace_value(text, "head_width", "-0.17"))
    (folder / "centimetres.yaml").write_text(replace_value(text, "head_width", "17"))
    (folder / "lacking.yaml").write_text(
        "\n".join(line for line in text.splitlines() if "head_width" not in line)
    )
    (folder / "empty folder").mkdir()
    with BagWriter(folder / "no images") as bag:
        bag.write_string("chatter", 1, "hello")
    with BagWriter(folder / "no camera_info") as bag:
        bag.write_image("/image_raw", 1, "camera", np.zeros((12, 16), np.uint8), "mono8")
    whole = next((folder / "session").glob("*.mcap")).read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    return Files(folder)


def replace_value(text: str, key: str, value: str) -> str:
    lines = [
        f"{line.split(':')[0]}: {value}" if line.strip().startswith(f"{key}:") else line
        for line in text.splitlines()
    ]
    assert lines != text.splitlines()
    return "\n".join(lines)


def assert_told(
    capsys: pytest.CaptureFixture[str], command: str, code: int, expected: tuple[str, ...]
) -> None:
    """The last line of stderr names the command and what was wrong; stdout is empty."""
    out, err = capsys.readouterr()
    assert code != 0
    assert "Traceback" not in err
    assert out == ""
    # Progress bars end without a line feed where they were interrupted.
    last = err.rstrip("\n").replace("\r", "\n").splitlines()[-1]
    assert f"cardbox {command}: " in last
    for part in expected:
        assert part in last


def test_there_are_the_commands_of_the_design() -> None:
    assert {"demo", "synthesize", "initialize", "track", "evaluate"} <= set(COMMANDS)


def test_help_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--help") == 0
    text = capsys.readouterr().out
    assert text.startswith("usage: cardbox ")
    for name in COMMANDS:
        assert re.search(rf"^ +{name}\s+[a-z]", text, re.MULTILINE)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself_and_its_options(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(name, "--help") == 0
    text = " ".join(capsys.readouterr().out.split())
    assert text.startswith(f"usage: cardbox {name} ")
    (choices,) = (a.choices for a in build_parser()._actions if isinstance(a.choices, dict))
    for action in choices[name]._actions:
        assert action.help, f"{name}: {action.dest} has no help"
        for option in action.option_strings:
            assert option in text


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert capsys.readouterr().out == f"cardbox {__version__}\n"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "required: COMMAND"),
        (("dance",), "invalid choice: 'dance'"),
        (("track",), "required: BAG, --background, --model, --start, --csv"),
        (("synthesize",), "required: --output"),
        (("urdf",), "required: MODEL.yaml"),
    ],
)
def test_what_is_missing_is_listed(
    words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*words) == 2
    err = capsys.readouterr().err
    assert err.startswith("usage: cardbox")
    assert expected in err.splitlines()[-1]


@pytest.mark.parametrize("text", ["5", "9:3", "a:b", "1:", "-2:3", "nan:4"])
@pytest.mark.parametrize("option", ["--background", "--front", "--side", "--arms"])
def test_a_span_that_is_none_is_refused(
    files: Files, option: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model = files / "new.yaml"
    words = [*SPANS, "--distance", "2", "--output", str(model), f"{option}={text}"]
    code = run("initialize", files / "session", *words)
    assert_told(
        capsys,
        "initialize",
        code,
        (
            option,
            f"'{text}' is no span; expected T0:T1",
        ),
    )
    assert not model.exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--start", "-1"), "--start: '-1' is no time; expected seconds from the start"),
        (("--start", "soon"), "'soon' is no time"),
        (("--start", "inf"), "'inf' is no time"),
        (("--start", "99"), "no image lies after --start 99 s"),
        (("--background", "90:99"), "0 images lie in the background span 90:99 s of a bag of"),
        (("--preset", "fast"), "invalid choice: 'fast' (choose from "),
        (("--strategy", "best"), "invalid choice: 'best' (choose from "),
        (("--particles", "1"), "'1' is no number of particles; expected a whole number from 2 on"),
        (("--particles", "2.5"), "'2.5' is no number of particles"),
        (("--particles", "9999999999"), "particles is 1e+10; expected 2 to 1e+06"),
        (("--seed", "-3"), "'-3' is no seed; expected a whole number from 0 on"),
        (("--seed", "x"), "'x' is no seed"),
        (("--model", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory; give the"),
        (("--model", "FOLDER/session"), "Is a directory"),
        (("--model", "FOLDER/text.txt"), "text.txt"),
        (("--model", "FOLDER/binary.yaml"), "binary.yaml"),
        (("--model", "FOLDER/list.yaml"), "list.yaml"),
        (("--model", "FOLDER/lacking.yaml"), "head_width"),
        (("--model", "FOLDER/negative.yaml"), "head_width is -0.17 m; expected 0.08 to 0.35 m"),
        (("--model", "FOLDER/centimetres.yaml"), "(is it given in centimetres?)"),
        (("--csv", "FOLDER/missing/out.csv"), "out.csv: No such file or directory; choose"),
        (("--csv", "FOLDER/text.txt/out.csv"), "out.csv: Not a directory; choose a folder"),
        (("--csv", "FOLDER/session"), "it is a folder; give the name of a file"),
        (("--video", "FOLDER/out.gif"), "its name must end in .mp4 or .avi"),
        (("--video", "FOLDER/missing/out.mp4"), "out.mp4: No such file or directory"),
        (("--bag", "FOLDER/session"), "is a recording already; choose another name or remove it"),
        (("--bag", "FOLDER/missing/out"), "No such file or directory; choose a folder"),
        (("--bag", "FOLDER/text.txt/out"), "Not a directory"),
    ],
)
def test_mistakes_of_track(
    files: Files, words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(path.name for path in files.folder.iterdir())
    good = {
        "--background": "0:3.9",
        "--model": f"{files / 'person.yaml'}",
        "--start": "15.6",
        "--csv": f"{files / 'out.csv'}",
    }
    option, value = words
    options = good | {option: value.replace("FOLDER", str(files.folder))}
    code = run("track", files / "session", *(f"{name}={text}" for name, text in options.items()))
    assert_told(capsys, "track", code, (expected,))
    # Nothing appears and nothing is lost.
    assert sorted(path.name for path in files.folder.iterdir()) == before


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("missing", "there is no recording"),
        ("empty folder", "no rosbag2 recording (it has no metadata.yaml)"),
        ("text.txt", "cannot read the recording"),
        ("person.yaml", "cannot read the recording"),
        ("no images", "has 0 image topics; expected one"),
        ("no camera_info", "has 0 CameraInfo topics; expected one"),
        ("cut.mcap", "cut.mcap"),
    ],
)
@pytest.mark.parametrize("command", ["initialize", "track"])
def test_recordings_that_are_none(
    files: Files, command: str, name: str, expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = files / "output"
    if command == "initialize":
        words: tuple[object, ...] = (*SPANS, "--distance", "2", "--output", output)
    else:
        model = files / "person.yaml"
        words = (*BACKGROUND, "--model", model, "--start", "1", "--csv", output)
    code = run(command, files / name, *words)
    assert_told(capsys, command, code, (expected, name))
    assert not output.exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--distance", "far"), "invalid float value: 'far'"),
        (("--distance", "-2"), "distance_m is -2 m; expected 0.3 to 20 m"),
        (("--distance", "0"), "distance_m is 0 m; expected 0.3 to 20 m"),
        (("--distance", "nan"), "distance_m is nan; expected a finite number of m"),
        (("--distance", "200"), "distance_m is 200 m; expected 0.3 to 20 m"),
        (("--camera-pitch-deg", "95"), "camera_pitch_rad is 1.65806 rad; expected -1.4 to 1.4 rad"),
        (("--side-turn", "back"), "invalid choice: 'back' (choose from "),
        (("--seed", "-1"), "'-1' is no seed"),
        (("--front", "90:99"), "no image lies in the front span 90:99 s of a bag of"),
        (("--front", "0:3"), "reference 'front': nobody is in the image"),
        (("--side", "6.6:8"), "'front' and 'side' are too alike"),
        (("--output", "FOLDER/missing/new.yaml"), "No such file or directory; choose a folder"),
        (("--output", "FOLDER/text.txt/new.yaml"), "Not a directory; choose a folder"),
        (("--output", "FOLDER/empty folder"), "cannot write the body model"),
    ],
)
def test_mistakes_of_initialize(
    files: Files, words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(path.name for path in files.folder.iterdir())
    option, value = words
    good = dict(zip(SPANS[::2], SPANS[1::2], strict=True))
    good |= {"--distance": "2", "--output": f"{files / 'new.yaml'}"}
    options = good | {option: value.replace("FOLDER", str(files.folder))}
    code = run(
        "initialize", files / "session", *(f"{name}={text}" for name, text in options.items())
    )
    assert_told(capsys, "initialize", code, (expected,))
    assert sorted(path.name for path in files.folder.iterdir()) == before


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("synthesize", "--motion", "dance", "--output", "FOLDER/new"), "'dance' is unknown"),
        (("synthesize", "--output", "FOLDER/session"), "is a recording already"),
        (("synthesize", "--output", "FOLDER/missing/new"), "No such file or directory"),
        (("synthesize", "--output", "FOLDER/text.txt/new"), "Not a directory"),
        (("synthesize", "--storage", "tape", "--output", "FOLDER/new"), "invalid choice: 'tape'"),
        (("demo", "--output", "FOLDER/text.txt"), "cannot make the folder"),
        (("demo", "--output", "FOLDER/new", "--preset", "fast"), "invalid choice: 'fast'"),
        (("urdf", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory"),
        (("urdf", "FOLDER/negative.yaml"), "head_width is -0.17 m"),
        (("evaluate", "--output", "FOLDER/new", "--runs", "1"), "'1' is no number of runs"),
        (("evaluate", "--output", "FOLDER/new", "--jobs", "0"), "'0' is no number of processes"),
        (("evaluate", "--output", "FOLDER/text.txt"), "text.txt"),
    ],
)
def test_mistakes_of_the_other_commands(
    files: Files, words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run(*(word.replace("FOLDER", str(files.folder)) for word in words))
    assert_told(capsys, words[0], code, (expected,))
    assert not (files / "new").exists()


def test_the_course_of_the_readme(files: Files, capsys: pytest.CaptureFixture[str]) -> None:
    """Initialize, track and urdf, one after the other, on files that each other wrote."""
    model, table, bag = files / "found.yaml", files / "found.csv", files / "found"
    words = ("initialize", files / "session", *SPANS, "--distance", "2", "--output", model)
    assert run(*words) == 0
    out = capsys.readouterr().out
    assert "upper_arm_length" in out
    assert f"wrote {model}" in out
    assert load_body_model(model).placement.distance_m == 2.0
    words = ("track", files / "session", *BACKGROUND, "--model", model, "--start", "15.6")
    assert run(*words, "--csv", table, "--bag", bag, "--preset", "paper", "--particles", 50) == 0
    out = capsys.readouterr().out
    rows = table.read_text().count("\n") - 1
    assert out.startswith(f"tracked {rows} of {rows} images, mean cost ")
    assert f"wrote {table}\nwrote {bag}\n" in out
    assert run("urdf", model) == 0
    assert "<robot" in capsys.readouterr().out


def test_an_interrupted_command_says_so(
    files: Files, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cardbox_tracker.commands.main.load_body_model", interrupted)
    assert run("urdf", files / "person.yaml") == 130
    assert_told(capsys, "urdf", 130, ("interrupted",))


WITHOUT_ROS = """
import sys
for name in ("rclpy", "std_msgs", "std_srvs", "sensor_msgs", "geometry_msgs"):
    sys.modules[name] = None  # an import of it fails, as where ROS is not installed
from cardbox_tracker.commands.main import main
sys.exit(main(sys.argv[1:]))
"""


def without_ros(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT_ROS, *map(str, words)]
    root = Path(__file__).resolve().parents[2]
    return subprocess.run(command, capture_output=True, text=True, cwd=root, check=False)


def test_recordings_need_no_ros(files: Files, tmp_path: Path) -> None:
    table = tmp_path / "person.csv"
    model = files / "person.yaml"
    words = (*BACKGROUND, "--model", model, "--start", "22", "--csv", table)
    done = without_ros("track", files / "session", *words)
    assert done.returncode == 0, done.stderr
    assert table.read_text().startswith("stamp,state,")


def test_what_needs_ros_says_so() -> None:
    done = without_ros("call", "initializer/initialize")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "ROS 2 is not installed" in done.stderr.splitlines()[-1]


def test_a_full_disk_is_told_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device", "somewhere")

    monkeypatch.setattr("cardbox_tracker.simulation.session.synthesize_session", full)
    assert main(["synthesize", "--output", str(tmp_path / "bag")]) == 1
    assert capsys.readouterr().err.endswith(
        "cardbox synthesize: somewhere: No space left on device\n"
    )


def test_a_missing_output_folder_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spans = ["--background", "0:4", "--front", "6:7", "--side", "9:10", "--arms", "12:13"]
    output = str(tmp_path / "none" / "body.yaml")
    given = ["initialize", "no_bag", *spans, "--distance", "2", "--output", output]
    assert main(given) == 1
    assert "No such file or directory; choose a folder" in capsys.readouterr().err
