"""Nodes as child processes, on a DDS domain of their own."""

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
from cardbox_tracker.errors import CardboxError

_STOP_S = 10.0


def isolate() -> None:
    """Keep this process and its children off other people's graphs; let large images through.

    A domain or profile that is set already is kept.
    """
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


class Nodes:
    """The running nodes; their output goes to one log file each."""

    def __init__(self, logs: Path) -> None:
        """Use the folder ``logs`` for what the nodes print."""
        self._logs = logs
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, name: str, *arguments: str, called: str = "") -> None:
        """Start the executable ``name`` of this package, see ``start.NODES``.

        Several of one name need different names here, which ``called`` gives them.
        """
        # -P: in a checkout, too, the installed package is run, whose kernels are compiled already.
        called = called or name
        with (self._logs / f"{called}.log").open("wb") as log:
            self._processes[called] = subprocess.Popen(
                [sys.executable, "-P", "-m", "cardbox_tracker.start", name, *arguments],
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def check(self) -> None:
        """Raise if a node died.

        Raises:
            CardboxError: with the node's last words.
        """
        for name, process in self._processes.items():
            if process.poll() not in (None, 0):
                words = (self._logs / f"{name}.log").read_text(errors="replace")[-800:]
                raise CardboxError(f"the node {name} ended with {process.returncode}:\n{words}")

    def pid(self, name: str) -> int:
        """Return the number of the node's process."""
        return self._processes[name].pid

    def text(self, name: str) -> str:
        """Return what the node has printed so far."""
        return (self._logs / f"{name}.log").read_text(errors="replace")

    def is_running(self, name: str) -> bool:
        """Return whether the node is still there."""
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
    """Context of nodes that are stopped at its end, whatever happens."""
    nodes = Nodes(logs)
    try:
        yield nodes
    finally:
        nodes.stop()
