"""Ctrl-C and SIGTERM in the first seconds end every program without a traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.start import NODES

_LIMIT_S = 60.0
PROGRAMS = tuple(NODES) if "RELIABILITY_EXAMPLES" in os.environ else ("tracker",)
# A node loads the libraries in this order, the last one in rclpy.init(); "" stands for none.
STAGES = ("", "numpy", "_rclpy_pybind11", "librmw_fastrtps")


def takes_signals(pid: int) -> bool:
    """Return whether a process has a handler for SIGTERM; Python itself has none."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    caught = next(line for line in lines if line.startswith("SigCgt"))
    return bool(int(caught.split()[1], 16) & (1 << (signal.SIGTERM - 1)))


def has_loaded(pid: int, library: str) -> bool:
    """Return whether a process has mapped a file with this name."""
    return library in Path(f"/proc/{pid}/maps").read_text()


def end_early(name: str, arguments: list[str], number: int, stage: str) -> tuple[int, str]:
    """Start a program and send it a signal when it has loaded a library.

    Returns:
        Its exit code and its output.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "cardbox_tracker.start", name, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "ROS_DOMAIN_ID": str(1 + os.getpid() % 100)},
    )
    end = time.monotonic() + _LIMIT_S
    while not (takes_signals(process.pid) and has_loaded(process.pid, stage)):
        assert time.monotonic() < end
        if process.poll() is not None:
            break
        time.sleep(0.002)
    process.send_signal(number)
    said, _ = process.communicate(timeout=_LIMIT_S)
    return process.returncode, said


@pytest.mark.promise("Signals and requests at any time are answered, without a traceback")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("name", PROGRAMS)
def test_a_node_that_is_starting_ends(name: str, number: int, stage: str) -> None:
    code, said = end_early(name, [], number, stage)
    assert "Traceback" not in said and "Exception" not in said, said
    # Three nodes end with an error without a device, a bag or a robot; a signal during their end
    # may then stop them like any process.
    assert code == 0 or (name in ("camera", "play_bag", "retarget") and code in (1, -number))


@pytest.mark.promise("Signals and requests at any time are answered, without a traceback")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("stage", ["", "numpy"])
def test_a_command_that_is_starting_ends(number: int, stage: str, tmp_path: Path) -> None:
    arguments = ["synthesize", "--motion", "wave", "--output", str(tmp_path / "bag")]
    code, said = end_early("cardbox", arguments, number, stage)
    assert "Traceback" not in said and "Exception" not in said, said
    # Before the command has begun, SIGTERM ends it like any process.
    assert code in ((130,) if number == signal.SIGINT else (143, -15))
    assert not (tmp_path / "bag").exists()


def test_a_node_that_has_ended_has_left_the_graph(own_graph: Any) -> None:
    def listed() -> bool:
        return name in own_graph.node.get_node_names()

    # A participant that is not taken off the network stays for its lease of 20 s. The message that
    # takes it off is sent once, and a busy machine may lose it.
    for name in ("first", "second", "third"):
        process = own_graph.start("stereo_depth", "--ros-args", "-r", f"__node:={name}")
        own_graph.wait(listed, "the node")
        assert process.stop() == 0
        with suppress(AssertionError):
            own_graph.wait(lambda: not listed(), "leaving the graph", timeout_s=8.0)
            return
    pytest.fail("the node stayed in the graph for its lease, three times")
