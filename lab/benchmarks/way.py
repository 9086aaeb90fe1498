"""The way of an image through the nodes: the milliseconds from its stamp to the JointState."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.runtime.processes import Nodes, isolate
from lab.benchmarks.nodes import SEPARATE, TOGETHER, CameraAndListener
from lab.benchmarks.scene import make_scene
from lab.pages import plot

STEPS = (
    "to the background node",
    "conversion",
    "silhouette",
    "to the tracker",
    "posture",
    "publishing",
    "to the subscriber's callback",
)
"""Parts of the way in their order."""
WORK = ("silhouette", "posture")
"""Parts that are estimation; the others are the way."""
RATE_HZ = 30.0

_ORDER = ("received", "converted", "cut out", "delivered", "tracked")
_TRACED = Path(__file__).with_name("traced_nodes.py")


class _TracedNodes(Nodes):
    """Nodes that write their notes into a folder when they end."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._folder = folder

    def _program(self, called: str) -> list[str]:
        notes = self._folder / f"{called}.json"
        # With -P the installed package runs, whose code is compiled, as in the other tables.
        return [sys.executable, "-P", str(_TRACED), str(notes)]

    def notes(self) -> dict[int, dict[str, int]]:
        """Return the times of all hand-overs, ns, by the image's stamp."""
        merged: dict[int, dict[str, int]] = {}
        for path in self._folder.glob("*.json"):
            for stamp, times in json.loads(path.read_text(encoding="ascii")).items():
                merged.setdefault(int(stamp), {}).update(times)
        return merged


def measure_way(seconds: float) -> dict[str, Any]:
    """Measure the steps of grey images of 320x240 at 30 Hz, in three processes and in one.

    Returns:
        For each way the percentiles of each step, of the estimation and of the rest, ms.
    """
    isolate()
    ways = {"three processes": SEPARATE, "one process": TOGETHER}
    return {name: _measure(processes, seconds) for name, processes in ways.items()}


def _measure(processes: tuple[str, ...], seconds: float) -> dict[str, Any]:
    scene = make_scene(320, 240, 60)
    with TemporaryDirectory() as folder:
        nodes = _TracedNodes(Path(folder))
        camera = CameraAndListener(nodes, processes)
        try:
            model = Path(folder) / "body.yaml"
            save_body_model(scene.body, model)
            for name in processes:
                camera.start(name, model)
            camera.learn(scene, "mono8")
            camera.measure(scene, "mono8", RATE_HZ, seconds)
            arrivals_ns = camera.arrivals_ns
        finally:
            camera.close()
            nodes.stop()
        return steps_of(nodes.notes(), arrivals_ns)


def steps_of(
    notes: Mapping[int, Mapping[str, int]], arrivals_ns: Mapping[int, tuple[int, int]]
) -> dict[str, Any]:
    """Return the percentiles of the steps, ms.

    Args:
        notes: times of the hand-overs of each image, ns, by its stamp, ns.
        arrivals_ns: times at which the JointState was in the subscriber's callback, and in its
            process, ns, by the same stamp.
    """
    times_ns = [
        [stamp, *(notes[stamp][name] for name in _ORDER), received_ns, called_ns]
        for stamp, (called_ns, received_ns) in arrivals_ns.items()
        if set(_ORDER) <= set(notes.get(stamp, ()))
    ]
    steps_ms = np.diff(np.array(times_ns, np.int64), axis=1) / 1e6
    work_ms = steps_ms[:, [STEPS.index(name) for name in WORK]].sum(axis=1)
    columns = {**dict(zip(STEPS, steps_ms.T, strict=True)), "estimation": work_ms}
    columns |= {"all but estimation": steps_ms.sum(axis=1) - work_ms, "all": steps_ms.sum(axis=1)}
    return {
        name: {f"p{p}_ms": float(np.percentile(values, p)) for p in (50, 95)}
        for name, values in columns.items()
    }


def plot_way(ways: Mapping[str, Any], path: Path) -> None:
    """Plot the medians of the steps of each way as one bar each."""
    with plot(path, (1, 1), (8.0, 2.2), dpi=90, layout=None) as axes:
        (axis,) = axes[0]
        for row, (way, measured) in enumerate(ways.items()):
            begin_ms = 0.0
            for number, step in enumerate(STEPS):
                length_ms = max(measured[step]["p50_ms"], 0.0)
                label = step if row == 0 else None
                axis.barh(way, length_ms, left=begin_ms, color=f"C{number}", label=label)
                begin_ms += length_ms
        axis.set_xlabel("median time since the image's stamp [ms]")
        place = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
        axis.legend(fontsize=7, ncols=4, frameon=False, **place)
