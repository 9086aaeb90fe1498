"""Nodes as child processes in a separate DDS domain."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cardbox_tracker
from cardbox_tracker.common.errors import CardboxError

_STOP_S = 10.0
# Characters of a failed process's output that an error shows.
_SHOWN = 800
# With -P the installed package runs, also in a checkout.
_OF_PACKAGE = (sys.executable, "-P", "-m")


def isolate() -> None:
    """Give this process and its children, unless set, a domain and a profile for large images."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(random.SystemRandom().randint(1, 100)))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    profile = share_file("config/fastdds_large_images.xml")
    if profile is not None:
        os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))


def share_file(name: str) -> Path | None:
    """Return an installed data file of the package, or the one in its source tree."""
    candidates = [Path(sys.prefix) / "share" / "cardbox_tracker" / name]
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    candidates += [Path(p) / "share" / "cardbox_tracker" / name for p in prefixes if p]
    candidates.append(Path(cardbox_tracker.__file__).parents[1] / name)
    return next((path for path in candidates if path.exists()), None)


def compile_kernels() -> None:
    """Compile what the nodes run, unless it is kept; raise CardboxError if that fails."""
    done = subprocess.run(
        [*_OF_PACKAGE, "cardbox_tracker.tracking.precompile"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    if done.returncode:
        raise CardboxError(
            f"the compilation of the tracker's inner loop ended with {done.returncode}; install "
            f"the package anew with 'make setup' or pip:\n{done.stdout[-_SHOWN:]}"
        )


class Nodes:
    """Running nodes, each with its own log file."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *arguments: str, called: str = "") -> None:
        """Start the executable ``name`` of ``start.NODES``, as ``called`` if there are several."""
        called = called or name
        with (self._logs / f"{called}.log").open("wb") as log:
            self._processes[called] = subprocess.Popen(
                [*self._program(called), name, *arguments], stdout=log, stderr=subprocess.STDOUT
            )

    def _program(self, called: str) -> list[str]:
        return [*_OF_PACKAGE, "cardbox_tracker.start"]

    def check(self) -> None:
        """Raise CardboxError, with the end of its log, if a node died."""
        for name, process in self._processes.items():
            if process.poll() not in (None, 0):
                words = self.text(name)[-_SHOWN:]
                raise CardboxError(f"the node {name} ended with {process.returncode}:\n{words}")

    def pid(self, name: str) -> int:
        """Return the process ID of the node."""
        return self._processes[name].pid

    def text(self, name: str) -> str:
        """Return the node's output so far."""
        return (self._logs / f"{name}.log").read_text(errors="replace")

    def is_running(self, name: str) -> bool:
        """Return whether the node's process is still running."""
        return self._processes[name].poll() is None

    def stop(self) -> None:
        """Ask all nodes to end; kill those that do not."""
        for process in self._processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        for process in self._processes.values():
            try:
                process.wait(timeout=_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def running_nodes(logs: Path) -> Iterator[Nodes]:
    """Context of nodes that are always stopped at its end."""
    nodes = Nodes(logs)
    try:
        yield nodes
    finally:
        nodes.stop()
