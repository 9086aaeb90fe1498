"""Ratios of times in one run, which other load on the machine changes less than the times.

``python -m lab.benchmarks.ratios`` measures them and replaces them in ``docs/benchmarks.json`` and
``docs/benchmarks.md``.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import WAVE_S, wave
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import (
    SyntheticCamera,
    synthesize_session,
    synthetic_cameras,
)
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker
from lab.benchmarks.report import replace_part
from lab.benchmarks.scene import WARM_UP, BenchmarkScene, make_scene, pinned
from lab.benchmarks.silhouette import colored, measure_silhouettes
from lab.evaluation.results import commit

RECORDINGS = 8
"""Number of recordings in the folder that is tracked."""

IMPORTS = "import rclpy, numba, cv2, numpy"
"""Statement of the process that the nodes are compared with."""
PROCESSES = {"background": 1, "initializer": 1, "tracker": 1, "cardbox_nodes": 3}
"""Executables, with the number of nodes in each."""

_WAITS = "waiting for "
_IMAGES = 150
# The empty scene of a session, and its first image after the reference postures.
_BACKGROUND, _START = "0:3.9", "15.6"


def measure_ratios(has_ros: bool) -> dict[str, Any]:
    """Measure all ratios; those of the nodes' start only with ROS."""
    with pinned(1):
        scene = make_scene(320, 240, _IMAGES)
        silhouette = measure_silhouettes(*colored(scene))
        views = measure_two_views(scene)
    return {
        "commit": commit(),
        "silhouette": silhouette,
        "two_views": views,
        "start": measure_start() if has_ros else None,
        "folder": measure_folder(),
    }


def measure_folder(repetitions: int = 3) -> float:
    """Return how many times faster two processes track a folder of eight recordings than one.

    The medians of the repetitions are compared, and the numbers of processes take turns.
    """
    spent_s: dict[int, list[float]] = {1: [], 2: []}
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "recordings"
        folder.mkdir()
        body = BodyModel.of(hip_height_m=-0.51)
        synthesize_session(folder / "session0", "wave", body=body)
        for number in range(1, RECORDINGS):
            shutil.copytree(folder / "session0", folder / f"session{number}")
        model = Path(temporary) / "body.yaml"
        save_body_model(body, model)
        for _ in range(repetitions):
            for jobs, values in spent_s.items():
                output = Path(temporary) / "results"
                begun_s = time.monotonic()
                _track(folder, model, output, jobs)
                values.append(time.monotonic() - begun_s)
                shutil.rmtree(output)
    return float(np.median(spent_s[1]) / np.median(spent_s[2]))


def _track(folder: Path, model: Path, output: Path, jobs: int) -> None:
    """Run ``cardbox track`` for a folder."""
    command = [sys.executable, "-m", "cardbox_tracker.start", "cardbox", "track", str(folder)]
    command += ["--model", str(model), "--background", _BACKGROUND, "--start", _START]
    command += ["--output", str(output), "--jobs", str(jobs)]
    subprocess.run(command, check=True, capture_output=True)


def measure_two_views(scene: BenchmarkScene, repetitions: int = 3) -> float:
    """Return the time of a frame with two cameras as a multiple of that with one, a median.

    The cameras stand at the same distance from the person, and both trackers take turns at each
    frame. The shortest of several repetitions counts.
    """
    other = beside(scene)
    silhouettes = seen_by(scene, other)
    least_ms = np.full((2, len(silhouettes)), np.inf)
    for _ in range(repetitions):
        trackers = [
            Tracker(scene.body, scene.camera, default_preset(), others=others)
            for others in ((), (OtherCamera(other.camera, other.extrinsics),))
        ]
        for i, (first, second) in enumerate(zip(scene.silhouettes, silhouettes, strict=True)):
            seen = [Observation(first), Observation(second)]
            for count, tracker in enumerate(trackers, 1):
                start = time.perf_counter()
                tracker.track(seen[:count])
                spent_ms = 1e3 * (time.perf_counter() - start)
                least_ms[count - 1, i] = min(least_ms[count - 1, i], spent_ms)
    one_ms, two_ms = least_ms[:, WARM_UP:]
    return float(np.median(two_ms / one_ms))


def beside(scene: BenchmarkScene) -> SyntheticCamera:
    """Return a camera like the first one, at the same distance from the person."""
    return synthetic_cameras(scene.body, scene.camera, 2)[1]


def seen_by(scene: BenchmarkScene, other: SyntheticCamera) -> list[NDArray[np.uint8]]:
    """Return the silhouettes (H, W) of the scene in the image of ``other``."""
    renderer = Renderer(other.camera, np.random.default_rng(0))
    postures = (wave(i / 15.0 % WAVE_S) for i in range(len(scene.images)))
    return [renderer.silhouette(*other.seen(scene.body, posture)) for posture in postures]


def measure_start(repetitions: int = 5) -> dict[str, dict[str, float]]:
    """Return the median times from the start of each of ``PROCESSES`` until it waits for input.

    ``seconds``, and the ``ratio`` to a process that only executes ``IMPORTS``; they take turns on
    one core. Compiled code must be in the cache.

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
    return {
        name: {"seconds": median_s[name], "ratio": median_s[name] / median_s[""]}
        for name in PROCESSES
    }


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


if __name__ == "__main__":
    replace_part("ratios", lambda: measure_ratios(has_ros=True), __doc__)
