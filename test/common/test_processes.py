"""Calls in processes of one thread each."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import islice
from pathlib import Path

import pytest

from cardbox_tracker.common import interrupts, processes
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.processes import cores, results_of, shared_calls

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("jobs", [1, 2])
def test_all_results_come(jobs: int) -> None:
    with results_of(math.factorial, range(5), jobs) as found:
        assert sorted(found) == [1, 1, 2, 6, 24]


def test_processes_have_one_thread_and_leave_ctrl_c_to_their_parent() -> None:
    names = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"]
    with results_of(os.getenv, names, 2) as found:
        assert list(found) == ["1", "1", "1"]
    with results_of(partial(signal.pthread_sigmask, signal.SIG_BLOCK), [(), ()], 2) as masks:
        assert all(signal.SIGINT in mask for mask in masks)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_killed_process_is_told() -> None:
    with (
        pytest.raises(CardboxError, match=r"ended unexpectedly.*--jobs"),
        results_of(os._exit, [1, 1], 2) as found,
    ):
        list(found)
    with results_of(math.factorial, [3, 3], 2) as found:
        assert list(found) == [6, 6]


def test_processes_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    program = """
import os, sys, time
from pathlib import Path
from cardbox_tracker.common.processes import results_of

def wait_at(path):
    path.with_suffix(".new").write_text(str(os.getpid()))
    path.with_suffix(".new").rename(path)
    time.sleep(600)

with results_of(wait_at, [Path(sys.argv[1], str(n)) for n in range(2)], 2) as found:
    list(found)
"""
    parent = subprocess.Popen([sys.executable, "-c", program, str(tmp_path)], cwd=ROOT)
    end_s = time.monotonic() + 60.0
    while len(list(tmp_path.glob("?"))) < 2 and time.monotonic() < end_s:
        time.sleep(0.05)
    workers = [int(path.read_text()) for path in tmp_path.glob("?")]
    assert len(workers) == 2
    parent.kill()
    parent.wait()
    while any(map(lives, workers)) and time.monotonic() < end_s:
        time.sleep(0.05)
    assert not any(map(lives, workers))


def lives(process: int) -> bool:
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_copies_share_the_calls(tmp_path: Path) -> None:
    def write(number: int) -> None:
        time.sleep(0.05)
        with Path(tmp_path, str(os.getpid())).open("a") as file:
            file.write(f"{number}\n")

    assert list(shared_calls(write, range(4), 1)) == [0.0, 0.25, 0.5, 0.75]
    assert len(list(tmp_path.iterdir())) == 1
    fractions = list(shared_calls(write, range(4, 16), 3))
    assert fractions == sorted(fractions) and len(fractions) < 12
    written = [path.read_text().split() for path in tmp_path.iterdir()]
    assert len(written) == 3
    assert sorted(int(number) for numbers in written for number in numbers) == [*range(16)]


def test_a_copy_that_fails_is_told_and_leaving_ends_it(tmp_path: Path) -> None:
    parent, copy = os.getpid(), tmp_path / "copy"

    def fail(_: int) -> None:
        if os.getpid() != parent:
            raise ValueError
        time.sleep(0.5)

    def wait(_: int) -> None:
        if os.getpid() != parent:
            (tmp_path / "new").write_text(str(os.getpid()))
            (tmp_path / "new").rename(copy)
            time.sleep(600)
        while not copy.exists():
            time.sleep(0.01)

    with pytest.raises(CardboxError, match="ended unexpectedly, perhaps because the memory"):
        list(shared_calls(fail, range(9), 2))
    calls = shared_calls(wait, range(9), 2)
    next(calls)
    assert lives(int(copy.read_text()))
    calls.close()
    assert not lives(int(copy.read_text()))


class Late(list[int]):
    """Arguments of which the last ones come when the first calls have ended."""

    def __iter__(self) -> Iterator[int]:
        yield from self[:2]
        time.sleep(1.0)
        yield from self[2:]


def test_a_process_that_is_killed_while_others_get_their_calls_is_told() -> None:
    with (
        pytest.raises(CardboxError, match=r"ended unexpectedly.*--jobs"),
        results_of(os._exit, Late([1, 1, 1, 1]), 2) as found,
    ):
        list(found)
    with results_of(math.factorial, [3, 3], 2) as found:
        assert list(found) == [6, 6]


def test_leaving_before_the_end_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    failed: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    for count in (0, 1, 5, 11):
        with results_of(time.sleep, [0.002 * (i % 3) for i in range(60)], 2) as found:
            for _ in islice(found, count):
                pass
    assert not [repr(one.exc_value) for one in failed]


def test_a_withheld_ctrl_c_comes_at_the_end() -> None:
    reached = []
    with pytest.raises(KeyboardInterrupt), interrupts.raised(), interrupts.withheld():
        os.kill(os.getpid(), signal.SIGINT)
        reached.append(1)
    assert reached


def test_there_is_a_core() -> None:
    assert 1 <= cores() <= len(os.sched_getaffinity(0))


@pytest.mark.timeout(20)
@pytest.mark.parametrize("scheme", ["tcp", "tls", "ucx"])
@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(range(256))])
def test_a_server_that_is_no_scheduler_is_told_in_time(
    answer: bytes, scheme: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("distributed", reason="dask is not installed")
    monkeypatch.setattr(processes, "_CONNECT_S", 0.3)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with suppress(OSError):
                kept.append(server.accept()[0])
                kept[-1].sendall(answer)

        kept: list[socket.socket] = []
        threading.Thread(target=serve, daemon=True).start()
        address = f"{scheme}://127.0.0.1:{server.getsockname()[1]}"
        with (
            pytest.raises(CardboxError, match=f"no Dask scheduler answers at {address}"),
            results_of(str, [1], 1, address),
        ):
            pass
    for one in kept:
        one.close()
    assert not caplog.records
