"""Time from the start of a node's process until it waits for input.

It is compared, in turns on one core, with a process that only imports rclpy, numba, OpenCV and
numpy. Compiled code must be in the cache.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from lab.benchmarks.tools import pinned

IMPORTS = "import rclpy, numba, cv2, numpy"
"""Statement of the process that the nodes are compared with."""
PROCESSES = {"background": 1, "initializer": 1, "tracker": 1, "cardbox_nodes": 3}
"""Executables, with the number of nodes in each."""

_WAITS = "waiting for "


class Start(NamedTuple):
    """Start of a process: seconds until its nodes wait for input, and their multiple of imports."""

    seconds: float
    ratio: float


def measure_start(repetitions: int = 5) -> dict[str, Start]:
    """Return the medians for each process of ``PROCESSES``.

    Raises:
        CardboxError: a process ended before it was ready.
    """
    spent_s: dict[str, list[float]] = {name: [] for name in ("", *PROCESSES)}
    with TemporaryDirectory() as folder, pinned(1):
        model = Path(folder) / "body.yaml"
        save_body_model(BodyModel(), model)
        for _ in range(repetitions + 1):
            begun_s = time.monotonic()
            subprocess.run([sys.executable, "-c", IMPORTS], check=True)
            spent_s[""].append(time.monotonic() - begun_s)
            for name in PROCESSES:
                spent_s[name].append(_ready_s(name, model))
    # The first turn reads the files from the disk.
    median_s = {name: float(np.median(values[1:])) for name, values in spent_s.items()}
    return {name: Start(median_s[name], median_s[name] / median_s[""]) for name in PROCESSES}


def _ready_s(name: str, model: Path) -> float:
    """Start a process, return the seconds until all its nodes wait for input, and end it."""
    node = "tracker:" if name == "cardbox_nodes" else ""
    parameters = ["--ros-args", "-p", f"{node}model_file:={model}"]
    command = [sys.executable, "-m", "cardbox_tracker.start", name]
    if name in ("tracker", "cardbox_nodes"):
        command += parameters
    begun_s, left = time.monotonic(), PROCESSES[name]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            left -= _WAITS in line
            if not left:
                break
        spent_s = time.monotonic() - begun_s
        process.terminate()
    if left:
        raise CardboxError(f"the process {name} ended before its nodes were ready; start it alone")
    return spent_s
