"""'cardbox track' of a folder: the bytes, the resumption, failures and Ctrl-C."""

from __future__ import annotations

import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.commands import track_folder
from cardbox_tracker.commands.request import Request, with_own_options
from cardbox_tracker.commands.track_folder import digest_of_inputs
from cardbox_tracker.commands.tracking_request import TrackingRequest, tracking_request
from cardbox_tracker.common import processes
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.open_images import SUMMARY
from cardbox_tracker.recordings.track import TrackSummary

GIVEN = ("--model", "PERSON", "--background=0:3.9", "--start=15.6")


def words(files: Path) -> list[str]:
    return [word.replace("PERSON", str(files / "person.yaml")) for word in GIVEN]


def results(folder: Path) -> dict[str, bytes]:
    """Return the content of every file below a folder, by its path."""
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def rows(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / SUMMARY).open(newline="") as file:
        return {row["recording"]: row for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def recordings(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of two recordings that differ, and one that is cut off."""
    folder = tmp_path_factory.mktemp("many")
    shutil.copytree(files / "session", folder / "a")
    shutil.copytree(files / "session", folder / "anna" / "b")
    (folder / "anna" / "b.options").write_text("--start 17\n")
    shutil.copy(files / "cut.mcap", folder / "cut.mcap")
    (folder / "plan.txt").write_text("no recording")
    shutil.copy(files / "cut.mcap", folder / "cut2.mcap")
    return folder


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return where the results of two processes are to be."""
    return tmp_path_factory.mktemp("results") / "both"


def test_two_processes_write_the_bytes_of_one_after_the_other(
    files: Path,
    recordings: Path,
    both: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cardbox: Callable,
) -> None:
    monkeypatch.chdir(recordings.parent)
    given, alone, folder = words(files), tmp_path / "alone", recordings.name
    many = cardbox("track", folder, *given, "--output", both, "--jobs=2", "--formats", "bag")
    for name, start in (("a", "15.6"), ("anna/b", "17")):
        (alone / name).parent.mkdir(parents=True, exist_ok=True)
        outputs = (f"--csv={alone / name}.csv", f"--bag={alone / name}.bag")
        assert cardbox("track", recordings / name, *given, f"--start={start}", *outputs).code == 0
    found = results(both)
    assert found.pop(SUMMARY)
    assert found == results(alone)
    # The others are done, and the failures are told at the end.
    assert many.code == 1
    assert "Traceback" not in many.err
    *_, failed, reason = many.err.replace("\r", "\n").splitlines()
    assert failed == "cardbox track: 2 of 4 recordings failed"
    assert reason.startswith("  cut, cut2: cannot read the recording")
    assert re.search(r"(?m)^a +\d+ +\d+ +\d+ +0\.\d+$", many.out)
    assert re.search(r"(?m)^cut +failed$", many.out)
    status = {name: row["status"] for name, row in rows(both).items()}
    assert status == {"a": "tracked", "anna/b": "tracked", "cut": "failed", "cut2": "failed"}


@pytest.fixture(scope="module")
def scheduler() -> Iterator[Any]:
    """A Dask cluster of two local workers, which begin in another folder."""
    distributed = pytest.importorskip("distributed", reason="dask is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1"
    ) as cluster:
        yield cluster


def test_a_dask_cluster_writes_the_same_bytes(
    files: Path,
    recordings: Path,
    both: Path,
    tmp_path: Path,
    scheduler: Any,
    monkeypatch: pytest.MonkeyPatch,
    cardbox: Callable,
) -> None:
    """Paths are relative to the folder of the command, not to that of the workers."""
    monkeypatch.chdir(recordings.parent)
    given = (*words(files), "--formats=bag", "--scheduler", scheduler.scheduler_address)
    output = os.path.relpath(tmp_path / "there")
    there = cardbox("track", recordings.name, *given, "--output", output)
    assert there.code == 1, there.err
    assert "2 of 4 recordings failed\n  cut, cut2: cannot read" in there.err
    assert results(tmp_path / "there") == results(both)
    monkeypatch.setattr(track_folder, "digest_of_program", lambda: "another")
    there = cardbox("track", recordings.name, *given, "--output", output)
    assert "another version of the package" in there.err


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--jobs=2",), "--jobs has no effect with --scheduler"),
        (("--output", "new"), "no Dask scheduler answers at tcp://127.0.0.1:9"),
    ],
)
def test_a_cluster_that_is_none_is_told(
    files: Path,
    recordings: Path,
    tmp_path: Path,
    options: tuple[str, ...],
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
    cardbox: Callable,
) -> None:
    pytest.importorskip("distributed", reason="dask is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(processes, "_CONNECT_S", 0.5)
    given = (*words(files), "--scheduler", "tcp://127.0.0.1:9", *options)
    done = cardbox("track", recordings, *given)
    assert done.code == 1 and expected in done.err


def test_workers_with_several_threads_are_refused() -> None:
    distributed = pytest.importorskip("distributed", reason="dask is not installed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
        ) as cluster,
        pytest.raises(CardboxError, match=r"1 workers with 2 threads; expected .*--nthreads 1"),
        processes.results_of(str, [1], 1, cluster.scheduler_address),
    ):
        pass


def files_of(names: Iterable[str]) -> set[str]:
    """Return the files of recordings that are done: a table and a body each."""
    return {
        SUMMARY,
        *(f"{name}{end}" for name in names for end in (".csv", ".body.yaml", ".scene.yaml")),
    }


class Tracked:
    """Stands for the tracking of a recording: it writes the table and notes the name.

    Attributes:
        names: recordings that were tracked.
        errors: what is raised for a recording.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.errors: dict[str, BaseException] = {}

    def __call__(self, request: TrackingRequest, show: Any) -> TrackSummary:
        name = request.recording.path.stem
        self.names.append(name)
        for path in (one for one in request.files or () if isinstance(one, Path)):
            path.write_text(f"{name} with effort {request.config.whole_body.effort}")
        if name in self.errors:
            raise self.errors[name]
        show(0.5)
        print("cardbox: a remark", file=sys.stderr)
        return TrackSummary(10, 8, 12.34, 0.9, 1)


@pytest.fixture
def tracked(monkeypatch: pytest.MonkeyPatch) -> Tracked:
    tracking = Tracked()
    monkeypatch.setattr(track_folder, "track", tracking)
    return tracking


@pytest.fixture
def track(files: Path, tmp_path: Path, cardbox: Callable, tracked: Tracked) -> Callable:
    """Track the films a, b and c, and return the recordings that were tracked."""
    folder = tmp_path / "films"
    folder.mkdir()
    shutil.copy(files / "person.yaml", folder / "person.yaml")
    for name in "abc":
        (folder / f"{name}.mp4").write_text(name)

    def run(*more: object, code: int = 0) -> list[str]:
        tracked.names.clear()
        given = ("--model", folder / "person.yaml", "--background=0:3.9", "--start=15.6")
        output = ("--fov=60", "--output", tmp_path / "out", "--jobs=1")
        done = cardbox("track", folder, *given, *output, *more)
        assert done.code == code, done.err
        run.done = done  # type: ignore[attr-defined]
        return sorted(tracked.names)

    return run


def test_finished_recordings_are_not_done_again(track: Callable, tmp_path: Path) -> None:
    assert track() == ["a", "b", "c"]
    before = results(tmp_path / "out")
    assert before.keys() == files_of("abc")
    assert track() == []
    assert "3 of 3 recordings are finished" in track.done.out
    assert results(tmp_path / "out") == before
    assert track("--force") == ["a", "b", "c"]
    assert results(tmp_path / "out") == before


def test_changes_are_done_again(track: Callable, tmp_path: Path) -> None:
    films, out = tmp_path / "films", tmp_path / "out"
    track()
    assert track("--effort=2") == ["a", "b", "c"]
    assert (out / "a.csv").read_text() == "a with effort 2.0"
    assert track("--effort=2", "--formats", "csv", "mp4") == ["a", "b", "c"]
    assert track("--effort=2", "--formats", "csv", "mp4", "--blur") == ["a", "b", "c"]
    assert track() == ["a", "b", "c"]
    assert results(out).keys() == files_of("abc")
    (films / "b.mp4").write_text("longer")
    assert track() == ["b"]
    (films / "c.options").write_text("--effort 0.5")
    assert track() == ["c"]
    (out / "a.csv").unlink()
    assert track() == ["a"]
    (films / "d.mp4").write_text("d")
    assert track() == ["d"]
    # The same settings, given otherwise, are the same request.
    (films / "settings.yaml").write_text("whole_body:\n  effort: 0.5\n")
    (films / "c.options").write_text("--settings settings.yaml")
    assert track() == []
    (films / "c.options").write_text("--settings settings.yaml --set lost_frames=9")
    assert track() == ["c"]
    text = (films / "person.yaml").read_text()
    (films / "person.yaml").write_text(text + "\n# measured again\n")
    assert track() == ["a", "b", "c", "d"]


def test_a_failure_is_named_and_tried_again(
    track: Callable, tracked: Tracked, tmp_path: Path
) -> None:
    track()
    tracked.errors = {"a": CardboxError("no image\nlies here"), "b": ZeroDivisionError("by zero")}
    assert track("--effort=2", code=1) == ["a", "b", "c"]
    assert "2 of 3 recordings failed\n  a: no image lies here\n" in track.done.err
    assert "  b: unexpected ZeroDivisionError: by zero; 'cardbox track'" in track.done.err
    assert "c: a remark\n" in track.done.err
    # Results of other settings would be taken for those of this run.
    assert results(tmp_path / "out").keys() == files_of("c")
    tracked.errors = {}
    assert track("--effort=2") == ["a", "b"]


def test_mistakes_in_the_options_of_one_do_not_stop_the_others(
    track: Callable, tmp_path: Path
) -> None:
    (tmp_path / "films" / "b.options").write_text("--distance far")
    assert track(code=1) == ["a", "c"]
    assert "1 of 3 recordings failed\n  b: " in track.done.err
    assert "b.options" in track.done.err


def test_options_that_all_recordings_lack_are_named_once(
    tmp_path: Path, cardbox: Callable, tracked: Tracked
) -> None:
    for number in range(12):
        (tmp_path / f"film_{number:02}.mp4").write_text("film")
    done = cardbox("track", tmp_path, "--background=0:3.9", "--output", tmp_path / "out")
    needed = "needs --fov DEG or --calibration FILE, and --stature M or --model FILE"
    done.assert_refused("track", needed, "(the same for all 12 recordings)")
    assert done.err.count("--stature") == 1
    assert tracked.names == []


def test_a_failure_of_many_recordings_is_named_once(
    track: Callable, tracked: Tracked, tmp_path: Path
) -> None:
    names = [f"film_{number:02}" for number in range(12)]
    for name in names:
        path = tmp_path / "films" / f"{name}.mp4"
        path.write_text(name)
        tracked.errors[name] = CardboxError(f"{path} is\nbroken")
    assert track(code=1) == ["a", "b", "c", *names]
    assert "12 of 15 recordings failed\n  film_00, film_01" in track.done.err
    assert f"film_09 and 2 more: {tmp_path / 'films' / names[0]}.mp4 is broken" in track.done.err
    assert track.done.err.count("broken") == 1
    assert all(rows(tmp_path / "out")[name]["reason"].endswith("is broken") for name in names)


def test_an_interrupted_run_leaves_nothing_half_done(
    track: Callable, tracked: Tracked, tmp_path: Path
) -> None:
    tracked.errors = {"b": KeyboardInterrupt()}
    track(code=130)
    done = sorted(set(tracked.names) - {"b"})
    assert results(tmp_path / "out").keys() == files_of(done)
    assert sorted(rows(tmp_path / "out")) == done
    tracked.errors = {}
    assert track() == sorted({"a", "b", "c"} - set(done))


def test_a_published_result_has_its_row_after_ctrl_c(
    track: Callable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish = track_folder._publish

    def interrupted(*given: Any) -> None:
        publish(*given)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(track_folder, "_publish", interrupted)
    (first,) = track(code=130)
    assert results(tmp_path / "out").keys() == files_of(first)
    assert list(rows(tmp_path / "out")) == [first]


def test_what_is_refused(track: Callable, tmp_path: Path, files: Path, cardbox: Callable) -> None:
    films = tmp_path / "films"
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("years of work")
    for given, expected in (
        (("--csv", tmp_path / "x.csv"), "--csv has no effect on"),
        (("--formats", "csv", "parquet"), "csv and parquet; give one"),
        (("--output", tmp_path / "other"), "other exists and has no _summary.csv"),
        (("--output", films), "it is read"),
        (("--output", films / "a.mp4"), "it is read"),
    ):
        assert track(*given, code=1) == []
        track.done.assert_refused("track", expected)
    one = cardbox("track", files / "session", *words(files), "--jobs=2")
    one.assert_refused("track", "--jobs has no effect on", "which is one recording")
    (tmp_path / "out").mkdir(exist_ok=True)
    (tmp_path / "out" / SUMMARY).write_text("year,income\n")
    assert track(code=1) == []
    track.done.assert_refused("track", "expected a summary of tracked recordings")


def test_the_person_may_be_in_the_files_alone(
    files: Path, tmp_path: Path, tracked: Tracked, cardbox: Callable
) -> None:
    for name in "ab":
        (tmp_path / f"{name}.mp4").write_text(name)
    (tmp_path / "a.options").write_text("--stature 1.7")
    done = cardbox("track", tmp_path, "--fov=60", "--output", tmp_path / "out", "--jobs=1")
    assert (done.code, tracked.names) == (1, ["a"])
    assert f"  b: {tmp_path / 'b.mp4'} needs --stature M or --model FILE" in done.err
    assert results(tmp_path / "out").keys() == files_of("a")


def test_ctrl_c_ends_all_processes_without_a_traceback(files: Path, tmp_path: Path) -> None:
    out, folder = tmp_path / "out", tmp_path / "many"
    for number in range(8):
        shutil.copytree(files / "session", folder / f"{number}")
    command = [sys.executable, "-m", "cardbox_tracker.start", "cardbox", "track", str(folder)]
    given = [*words(files), "--jobs=2", f"--output={out}"]
    with subprocess.Popen(
        command + given, stderr=subprocess.PIPE, start_new_session=True, text=True
    ) as process:
        # The first result shows that others are being tracked.
        while not list(out.glob("[0-9].csv")):
            assert process.poll() is None
            time.sleep(0.02)
        # A terminal sends it to all processes.
        os.killpg(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Traceback" not in said
    assert said.rstrip().endswith("cardbox track: interrupted")
    # Finished results are whole, and nothing else is left.
    done = rows(out)
    assert 1 <= len(done) < 8
    assert results(out).keys() == files_of(done)


def test_results_of_a_name_too_long_for_a_file_are_not_there(tmp_path: Path) -> None:
    track_folder._remove(tmp_path, 251 * "x")


def test_options_beside_a_recording_name_no_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "evil.py").write_text("raise SystemExit('code of the data ran')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    typed = Request(tmp_path)
    words = ("--corrector", "--detector", "--silhouettes", "--set corrector", "--preset")
    for word in words:
        given = word + ("=" if word.startswith("--set") else " ") + "evil:function"
        (tmp_path / "a.options").write_text(f"{given} --stature 1.7 --background 0:1")
        with pytest.raises(CardboxError):
            tracking_request(with_own_options(typed, tmp_path, "a"))
    assert "evil" not in sys.modules


def test_a_path_that_begins_like_a_formula_is_no_cell_of_one() -> None:
    error = CardboxError("=1+1.mp4 cannot be read\x1b[2J\udcff")
    reason = track_folder.Row.failed("./=1+1", error).reason
    assert reason == r"(=1+1.mp4 cannot be read\x1b[2J\udcff)"


def test_a_huge_summary_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / SUMMARY).open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(CardboxError, match="a summary of tracked"):
        track_folder._read_rows(tmp_path / SUMMARY)


def test_files_of_a_recording_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    request = tracking_request(Request(folder, stature_m=1.7, background=(0, 1)))
    before = digest_of_inputs(request, ("csv",), "program")
    try:
        Path(os.fsdecode(os.fsencode(folder) + b"/\xff.png")).touch()
    except OSError:
        pytest.skip("this file system has UTF-8 names only")
    assert digest_of_inputs(request, ("csv",), "program") != before
