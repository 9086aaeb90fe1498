"""Shared argument types, outputs that are allowed, and signals that leave nothing half done."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cardbox_tracker.commands.arguments import at_least, between, check_outputs, span, time
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_writer import BagWriter


def test_what_is_right_is_read() -> None:
    assert span("0:3.9") == (0.0, 3.9)
    assert time("15.6") == 15.6
    assert [at_least(0)("0"), at_least(2)("2"), at_least(2)("17")] == [0, 2, 17]
    assert [between(-45, 45)("-45"), between(0, 9)("0.1")] == [-45.0, 0.1]


@pytest.mark.parametrize("text", ["5", "9:3", "3:3", "a:b", "1:", "-2:3", "nan:4", ""])
def test_spans_that_are_none(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        span(text)
    assert str(caught.value) == (
        f"expected T0:T1, seconds from the start of the recording with T0 before T1, got {text!r}"
    )


@pytest.mark.parametrize("text", ["-1", "soon", "inf", "nan", ""])
def test_times_that_are_none(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        time(text)
    assert "seconds" in str(caught.value) and repr(text) in str(caught.value)


@pytest.mark.parametrize("text", ["-1", "2.5", "many", ""])
@pytest.mark.parametrize("lowest", [0, 1, 2])
def test_numbers_that_are_none(lowest: int, text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as caught:
        at_least(lowest)(text)
    assert f"{lowest} or more" in str(caught.value) and repr(text) in str(caught.value)


@pytest.mark.parametrize("lowest", [1, 2])
def test_numbers_that_are_too_low(lowest: int) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"{lowest} or more"):
        at_least(lowest)(str(lowest - 1))


@pytest.mark.parametrize(("lowest", "text"), [(0.0, "0"), (0.0, "9.1"), (-1.0, "-2"), (0.0, "nan")])
def test_numbers_out_of_range(lowest: float, text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=f"to 9, got '{text}'"):
        between(lowest, 9.0)(text)


@pytest.mark.promise("No command writes what it reads")
def test_an_input_is_refused_by_whatever_name(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    recording = tmp_path / "bag" / "bag.mcap"
    recording.write_text("images")
    (tmp_path / "linked.csv").symlink_to(recording)
    (tmp_path / "hard.csv").hardlink_to(recording)
    for name in ("linked.csv", "hard.csv", "bag/bag.mcap", "bag/../bag/bag.mcap"):
        with pytest.raises(CardboxError, match=r"bag\.mcap; .*another name"):
            check_outputs((tmp_path / name,), force=True, inputs=(tmp_path / "bag",))
    check_outputs((tmp_path / "bag" / "other.csv",), force=False, inputs=(tmp_path / "bag",))


def test_only_what_would_be_lost_needs_force(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "old.csv").touch()
    os.mkfifo(tmp_path / "fifo")
    devices = (Path("/dev/null"), Path("/dev/null"), tmp_path / "fifo", None)
    check_outputs((tmp_path / "new.csv", *devices), False, results=(tmp_path / "empty",))
    check_outputs((tmp_path / "old.csv",), force=True)
    for results in ((tmp_path / "old.csv",), (tmp_path,)):
        with pytest.raises(CardboxError, match=r"exists.*--force"):
            check_outputs((), force=False, results=results)


def test_synthesize_replaces_a_recording_with_force(
    files: Path, tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: dict[str, object] = {}

    def synthesize(*_: object, **options: object) -> None:
        called.update(options)

    monkeypatch.setattr(
        "cardbox_tracker.applications.simulation.session.synthesize_session", synthesize
    )
    assert cardbox("synthesize", "--output", files / "session", "--force").code == 0
    assert called["overwrite"] is True


def test_evaluate_does_not_replace_a_report_but_resumes_without_one(
    tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[Path] = []
    monkeypatch.setattr("lab.experiments.evaluate.evaluate", lambda *given: done.append(given[0]))
    (tmp_path / "parts").mkdir()
    assert cardbox("evaluate", "--output", tmp_path).code == 0
    (tmp_path / "report.md").write_text("days of work")
    cardbox("evaluate", "--output", tmp_path).assert_refused("evaluate", "report.md exists")
    assert cardbox("evaluate", "--output", tmp_path, "--force").code == 0
    assert done == [tmp_path, tmp_path]


SLOW = """
import signal, sys, time
from pathlib import Path
from cardbox_tracker.commands import main, synthesize
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.recordings.bag_writer import BagWriter

def run(options):
    with BagWriter(options.output / "bag") as bag, atomic_path(options.output / "out.csv"):
        bag.write_string("chatter", 1, "hello")
        print("begun", flush=True)
        signal.pause()

# Below nohup it is ignored, which the command respects.
signal.signal(signal.SIGHUP, signal.SIG_DFL)
synthesize.run = run
sys.exit(main.main(["synthesize", "--output", sys.argv[1]]))
"""


@pytest.mark.promise("SIGINT, SIGTERM and SIGHUP leave nothing half written")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_leaves_nothing_behind(number: signal.Signals, tmp_path: Path) -> None:
    command = [sys.executable, "-c", SLOW, str(tmp_path)]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "begun\n"
        assert len(os.listdir(tmp_path)) == 2
        process.send_signal(number)
        _, told = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    word = "interrupted" if number == signal.SIGINT else "terminated"
    assert told == f"cardbox synthesize: {word}\n"
    assert os.listdir(tmp_path) == []


def test_what_a_killed_command_left_is_removed_by_the_next(tmp_path: Path) -> None:
    command = [sys.executable, "-c", SLOW, str(tmp_path)]
    with subprocess.Popen(command, stdout=-1, stderr=-1, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "begun\n"
        process.kill()
    assert len(os.listdir(tmp_path)) == 2
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_string("chatter", 1, "hello")
    assert sum(name.startswith(".bag") for name in os.listdir(tmp_path)) == 0
    with BagWriter(tmp_path / "bag", overwrite=True) as bag:
        bag.write_string("chatter", 1, "again")
    assert sorted(os.listdir(tmp_path / "bag")) == ["bag.mcap", "metadata.yaml"]
