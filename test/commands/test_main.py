"""The cardbox command as a whole: its help, its subcommands, and how each kind of error ends."""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cardbox_tracker import __version__
from cardbox_tracker.commands import call as command
from cardbox_tracker.commands import main as main_module
from cardbox_tracker.commands.main import COMMANDS, build_parser, from_checkout
from cardbox_tracker.common.errors import CardboxError

ROOT = Path(__file__).resolve().parents[2]
NAMES = [*COMMANDS]
# Modules beside the subcommands.
SHARED = {
    "__init__",
    "main",
    "arguments",
    "request",
    "tracking_request",
    "scene",
    "tracking",
    "track_folder",
}


def parsers() -> dict[str, argparse.ArgumentParser]:
    (choices,) = (a.choices for a in build_parser()._actions if isinstance(a.choices, dict))
    return choices


def test_each_module_is_a_subcommand_of_its_name() -> None:
    files = {path.stem for path in Path(main_module.__file__).parent.glob("*.py")}
    of_lab = {"benchmark", "evaluate"}
    assert files - SHARED == {name.replace("-", "_") for name in NAMES} - of_lab
    assert len(set(NAMES)) == len(NAMES)


def test_there_are_the_documented_subcommands() -> None:
    assert {"demo", "synthesize", "initialize", "track", "evaluate", "benchmark"} <= set(NAMES)


def test_help_lists_the_subcommands(cardbox: Callable) -> None:
    done = cardbox("--help")
    assert done.code == 0
    assert done.out.startswith("usage: cardbox ")
    for name in NAMES:
        assert re.search(rf"^ +{name}\s+[a-z]", done.out, re.MULTILINE)


@pytest.mark.parametrize("name", NAMES)
def test_every_subcommand_explains_itself_and_its_options(name: str, cardbox: Callable) -> None:
    done = cardbox(name, "--help")
    assert done.code == 0
    text = " ".join(done.out.split())
    assert text.startswith(f"usage: cardbox {name} ")
    actions = parsers()[name]._actions
    assert len(actions) > 1
    for action in actions:
        assert action.help, f"{name}: {action.dest} has no help"
        for option in action.option_strings:
            assert option in text or action.help == argparse.SUPPRESS


def test_version(cardbox: Callable) -> None:
    done = cardbox("--version")
    assert (done.code, done.out) == (0, f"cardbox {__version__}\n")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((), "required: COMMAND"),
        (("dance",), "invalid choice: 'dance'"),
        (("track",), "required: RECORDING"),
        (("synthesize",), "required: --output"),
        (("urdf",), "required: MODEL.yaml"),
    ],
)
def test_what_is_missing_is_listed(
    words: tuple[str, ...], expected: str, cardbox: Callable
) -> None:
    done = cardbox(*words)
    assert done.code == 2
    assert done.err.startswith("usage: cardbox")
    assert expected in done.err.splitlines()[-1]


def test_help_loads_no_large_library() -> None:
    program = (
        "import sys; from cardbox_tracker.commands.main import build_parser\n"
        "build_parser(['--help']).format_help()\n"
        "print([n for n in ('numpy', 'cv2', 'numba', 'rosbags', 'rclpy') if n in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout == "[]\n"


def test_an_interrupted_command_says_so(
    files: Path, monkeypatch: pytest.MonkeyPatch, cardbox: Callable
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cardbox_tracker.person.model_file.load_body_model", interrupted)
    done = cardbox("urdf", files / "person.yaml")
    assert done.code == 130
    done.assert_refused("urdf", "interrupted")


class NoMemory(Exception):
    """As OpenCV's."""

    code = -4


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device", "somewhere"), "somewhere: No space left on device"),
        (ImportError("x.so: failed to map segment"), "failed to map segment; allow more memory"),
        (MemoryError("Unable to allocate 9 GiB"), "Unable to allocate 9 GiB; allow more memory"),
        (MemoryError(), "no memory is left; allow more memory, as with 'ulimit -v', or install"),
        (NoMemory("Insufficient memory"), "Insufficient memory; allow more memory"),
    ],
)
def test_a_full_disk_or_memory_is_told_in_words(
    error: Exception, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cardbox: Callable
) -> None:
    def full(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("cardbox_tracker.applications.simulation.session.synthesize_session", full)
    done = cardbox("synthesize", "--output", tmp_path / "bag")
    assert done.code == 1
    done.assert_refused("synthesize", said)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("synthesize", "--motion", "dance", "--output", "FOLDER/new"), "'dance' is unknown"),
        (("synthesize", "--output", "FOLDER/session"), "session exists; choose another name"),
        (("synthesize", "--output", "FOLDER/missing/new"), "No such file or directory"),
        (("synthesize", "--output", "FOLDER/text.txt/new"), "Not a directory"),
        (
            ("synthesize", "--storage", "tape", "--output", "FOLDER/new"),
            "one of mcap, sqlite3, got",
        ),
        (("demo", "--output", "FOLDER/text.txt"), "cannot make the folder"),
        (
            ("demo", "--output", "FOLDER/new", "--preset", "fast"),
            "one of paper, default, got",
        ),
        (
            ("demo", "--live", "--output", "FOLDER/new", "--preset", "paper", "--cameras", "2"),
            "--preset paper is for one camera; leave it out with --cameras",
        ),
        (("urdf", "FOLDER/missing.yaml"), "missing.yaml: No such file or directory"),
        (("urdf", "FOLDER/negative.yaml"), "head_width is -0.17 m"),
        (("evaluate", "--output", "FOLDER/new", "--runs", "1"), "of 2 or more, got '1'"),
        (("evaluate", "--output", "FOLDER/new", "--jobs", "0"), "of 1 or more, got '0'"),
        (("evaluate", "--output", "FOLDER/text.txt"), "text.txt"),
    ],
)
def test_mistakes(files: Path, words: tuple[str, ...], expected: str, cardbox: Callable) -> None:
    done = cardbox(*(word.replace("FOLDER", str(files)) for word in words))
    done.assert_refused(words[0], expected)
    assert not (files / "new").exists()


def test_an_option_that_replaces_another_is_told(files: Path, cardbox: Callable) -> None:
    one, other = files / "missing.yaml", files / "text.txt"
    done = cardbox("demo", "--output", one, "--outp", other)
    assert "--output is given more than once; the last one counts" in done.err
    assert "more than once" not in cardbox("demo", "--output", other).err


def test_the_course_of_the_readme(
    files: Path, tmp_path: Path, spans: dict[str, str], cardbox: Callable
) -> None:
    """Initialize, track and urdf, one after the other, on files that each other wrote."""
    model, table, bag = (tmp_path / name for name in ("found.yaml", "found.csv", "found"))
    given = [word for item in spans.items() for word in item]
    done = cardbox("initialize", files / "session", *given, "--distance", "2", "--output", model)
    assert done.code == 0
    assert "upper_arm_length" in done.out
    assert f"wrote {model}" in done.out
    words = ("track", files / "session", *given[:2], "--model", model, "--start", "15.6")
    fewer = ("--set", "torso.particles=50", "--set", "arm.particles=50")
    done = cardbox(*words, "--csv", table, "--bag", bag, "--preset", "paper", *fewer)
    assert done.code == 0
    rows = table.read_text().count("\n") - 1
    assert done.out.startswith(f"tracked {rows} of {rows} images\n")
    assert "assumed: field of view " in done.out
    assert f"distance 2.00 m (from {model.name}), sizes from {model.name}\n" in done.out
    assert re.search(
        r"(?m)^sure: the posture in \d+% of \d+ images \(hands \d+%\), leans in ", done.out
    )
    assert "mean cost" not in done.out
    written = table, table.with_suffix(".body.yaml"), table.with_suffix(".scene.yaml"), bag
    assert "\n".join(f"wrote {path}" for path in written) in done.out
    done = cardbox("urdf", model)
    assert done.code == 0
    assert "<robot" in done.out


WITHOUT_ROS = """
import sys
for name in ("rclpy", "std_msgs", "std_srvs", "sensor_msgs", "geometry_msgs"):
    sys.modules[name] = None  # an import of it fails, as where ROS is not installed
from cardbox_tracker.commands.main import main
sys.exit(main(sys.argv[1:]))
"""


def without_ros(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT_ROS, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)


def test_recordings_need_no_ros(files: Path, tmp_path: Path) -> None:
    table = tmp_path / "person.csv"
    options = ("--background", "0:3.9", "--model", files / "person.yaml", "--start", "22")
    done = without_ros("track", files / "session", *options, "--csv", table)
    assert done.returncode == 0, done.stderr
    assert table.read_text().startswith("stamp,state,torso_y,")


def test_what_needs_ros_says_so() -> None:
    done = without_ros("call", "initializer/initialize")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "ROS 2 is not installed" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("statuses", "printed"),
    [
        (["measuring", "measured"], "measuring\nmeasured\n"),
        (["playing"], "playing\nmeasured\n"),
        ([], "measured\n"),
    ],
)
def test_an_answer_that_was_the_last_status_is_printed_once(
    statuses: list[str],
    printed: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from cardbox_tracker.ros.runtime import call

    def answered(service: str, say: Callable[[str], None]) -> str:
        for status in statuses:
            say(status)
        return "measured"

    monkeypatch.setattr(call, "call_service", answered)
    command.run(argparse.Namespace(service="initializer/initialize"))
    assert capsys.readouterr().out == printed


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package that does not lie in a checkout, run from a folder elsewhere."""
    monkeypatch.setattr(main_module, "_PACKAGE", tmp_path / "site-packages" / "cardbox_tracker")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "target"),
    [
        (("benchmark", "--json", "b.json"), "make benchmark"),
        (("evaluate", "--runs", "2", "--output", "out"), "make experiments"),
        (("evaluate", "--sessions", "a", "--output", "out"), "make sessions"),
        (("evaluate", "--films", "a", "--output", "out"), "make people"),
    ],
)
def test_without_a_checkout_the_make_target_is_named(
    words: tuple[str, ...], target: str, installed: Path, cardbox: Callable
) -> None:
    cardbox(*words).assert_refused(words[0], target)
    assert list(installed.iterdir()) == []


def test_the_checkout_is_found_from_a_folder_inside(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = installed / "checkout" / "docs"
    for name in ("docs", "cardbox_tracker", "of_a_checkout"):
        (installed / "checkout" / name).mkdir(parents=True)
    (installed / "checkout" / "of_a_checkout" / "__init__.py").touch()
    (installed / "checkout" / "of_a_checkout" / "run.py").write_text("ANSWER = 42\n")
    monkeypatch.chdir(folder)
    assert from_checkout("of_a_checkout.run", "nothing").ANSWER == 42


def test_a_missing_library_is_named(installed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (installed / "cardbox_tracker").mkdir()
    (installed / "needs_more").mkdir()
    (installed / "needs_more" / "__init__.py").write_text("import no_such_library\n")
    with pytest.raises(CardboxError, match=r"no_such_library.*pip install \."):
        from_checkout("needs_more", "nothing")


def test_beside_the_package_it_is_found_from_anywhere(tmp_path: Path) -> None:
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "from cardbox_tracker.commands.main import from_checkout\n"
        "print(from_checkout('lab.benchmarks.report', 'benchmark').COMMAND)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    assert done.stdout == "make benchmark\n"
