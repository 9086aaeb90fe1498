"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path, check_writable


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


def test_a_full_disk_is_told_with_the_path(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    with (
        pytest.raises(CardboxError, match=rf"cannot write {path}: No space left on device"),
        atomic_path(path),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert not list(tmp_path.iterdir())


def test_a_writer_that_replaced_the_temporary_file_is_fine(tmp_path: Path) -> None:
    target = tmp_path / "plot.png"
    with atomic_path(target) as path:
        path.unlink()
        path.write_bytes(b"png")
    assert target.read_bytes() == b"png"


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    target = tmp_path / "missing" / "person.csv"
    with (
        pytest.raises(CardboxError, match=r"person\.csv: No such file .*; choose"),
        atomic_path(target),
    ):
        pytest.fail("there is nothing to write to")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with (
        pytest.raises(CardboxError, match="Permission denied; choose"),
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
        pytest.raises(CardboxError, match=r"folder; .*name of a file"),
        atomic_path(name),
    ):
        pytest.fail("there is nothing to write to")
    assert os.listdir(tmp_path) == ["folder"]


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_a_link_is_followed_and_stays(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    target, link = tmp_path / "results" / "today.csv", tmp_path / "latest.csv"
    link.symlink_to(target)
    for text in ("first", "second"):
        with atomic_path(link) as path:
            path.write_text(text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert os.listdir(target.parent) == ["today.csv"]


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    first.symlink_to(second)
    second.symlink_to(first)
    for use in (check_writable, lambda path: atomic_path(path).__enter__()):
        with pytest.raises(CardboxError, match="first"):
            use(first)


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_a_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    fifo, read = tmp_path / "table.csv", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: read.append(fifo.read_text()))
    reader.start()
    with atomic_path(fifo) as path:
        path.write_text("row\n")
    reader.join(30)
    assert read == ["row\n"]
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert os.listdir(tmp_path) == ["table.csv"]


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_devices_stay_devices() -> None:
    check_writable("/dev/null")
    with atomic_path("/dev/null") as path:
        path.write_text("row\n")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    assert os.listdir("/dev").count("null") == 1


WRITE = """
import sys
from cardbox_tracker.common.files import atomic_path
with atomic_path(sys.argv[1]) as path:
    path.write_text("row\\n")
    print("ready", flush=True)
    if len(sys.argv) > 2:
        sys.stdin.read()
print("written")
"""


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"])
def test_standard_output_gets_it_in_its_turn(name: str, tmp_path: Path) -> None:
    for out in ("pipe", "file"):
        with (tmp_path / "out").open("w+") as file:
            stdout = subprocess.PIPE if out == "pipe" else file
            command = [sys.executable, "-c", WRITE, name]
            done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True)
            file.seek(0)
            text = done.stdout if out == "pipe" else file.read()
        assert (text, done.stderr) == ("ready\nrow\nwritten\n", "")


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_nothing_that_was_planted_is_opened(tmp_path: Path) -> None:
    """Whoever may write to the folder cannot know the temporary name before it is taken."""
    names = set()
    for _ in range(20):
        with atomic_path(tmp_path / "person.csv") as path:
            names.add(path.name)
            assert stat.S_IMODE(path.lstat().st_mode) & 0o022 == 0
    assert len(names) == 20
    precious = tmp_path / "precious"
    precious.write_text("mine")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("secrets.token_hex", lambda count: "0" * 2 * count)
        with atomic_path(tmp_path / "person.csv") as path:
            planted = path
        planted.symlink_to(precious)
        with pytest.raises(CardboxError, match="File exists"), atomic_path(tmp_path / "person.csv"):
            pytest.fail("a planted link was followed")
    assert precious.read_text() == "mine"


def test_the_replaced_files_permissions_are_kept(tmp_path: Path) -> None:
    target = tmp_path / "person.csv"
    target.touch(0o600)
    with atomic_path(target) as path:
        path.write_text("row")
    assert stat.S_IMODE(target.stat().st_mode) == 0o600


@pytest.mark.promise("Outputs are written whole or not at all, never over inputs")
def test_what_a_killed_writer_left_is_removed_and_a_living_ones_is_not(tmp_path: Path) -> None:
    target = tmp_path / "person.csv"
    command = [sys.executable, "-c", WRITE, str(target), "wait"]

    def begin() -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        writer = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        assert writer.stdout is not None and writer.stdout.readline() == "ready\n"
        return writer

    with begin() as killed, begin() as living:
        assert len(os.listdir(tmp_path)) == 2
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        (tmp_path / ".person.unfinished-notes.csv").write_text("somebody's own")
        with atomic_path(target) as path:
            path.write_text("ours")
        assert len(os.listdir(tmp_path)) == 3
        assert target.read_text() == "ours"
        living.communicate("")
    assert target.read_text() == "row\n"
    assert sorted(os.listdir(tmp_path)) == [".person.unfinished-notes.csv", "person.csv"]


@pytest.mark.parametrize("length", [240, 255])
def test_a_long_name_is_written_as_long_as_it_may_be(length: int, tmp_path: Path) -> None:
    target = tmp_path / ("n" * (length - 4) + ".csv")
    check_writable(target)
    with atomic_path(target) as path:
        path.write_text("row")
    assert target.read_text() == "row"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("n" * 256, "File name too long"),
        ("missing/person.csv", "No such file or directory"),
        ("file/person.csv", "Not a directory"),
        (".", "folder"),
    ],
)
def test_what_cannot_be_written_is_known_before_the_work(
    name: str, reason: str, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(CardboxError, match=reason):
        check_writable(tmp_path / name)
    assert os.listdir(tmp_path) == ["file"]
