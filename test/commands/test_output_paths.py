"""What a command may write to, and that its end by a signal leaves nothing half done."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cardbox_tracker.commands.output_paths import check_outputs
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.recordings.bag_writer import BagWriter


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
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

    monkeypatch.setattr("cardbox_tracker.simulation.session.synthesize_session", synthesize)
    assert cardbox("synthesize", "--output", files / "session", "--force").code == 0
    assert called["overwrite"] is True


def test_evaluate_does_not_replace_a_report_but_resumes_without_one(
    tmp_path: Path, cardbox: Callable, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[Path] = []
    monkeypatch.setattr("experiments.evaluate.evaluate", lambda *given: done.append(given[0]))
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
from cardbox_tracker.files import atomic_path
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


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
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
