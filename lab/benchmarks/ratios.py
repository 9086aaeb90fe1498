"""Ratios of times in one run, which other load on the machine changes less than the times.

``python -m lab.benchmarks.ratios`` measures them and replaces them in ``docs/benchmarks.json`` and
``docs/benchmarks.md``.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from cardbox_tracker.applications.simulation.session import synthesize_session
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from lab.benchmarks.report import write_report
from lab.benchmarks.scene import make_scene
from lab.benchmarks.silhouette import colored, measure_silhouettes
from lab.benchmarks.start import measure_start
from lab.benchmarks.tools import pinned
from lab.benchmarks.views import measure_two_views
from lab.evaluation.results import commit, read_json, write_json

RECORDINGS = 8
"""Number of recordings in the folder that is tracked."""

_IMAGES = 150
# The empty scene of a session, and its first image after the reference postures.
_BACKGROUND, _START = "0:3.9", "15.6"


def measure_ratios(has_ros: bool) -> dict[str, Any]:
    """Measure all ratios; those of the nodes' start only with ROS."""
    with pinned(1):
        scene = make_scene(320, 240, _IMAGES)
        silhouette = measure_silhouettes(*colored(scene))._asdict()
        views = measure_two_views(scene)
    return {
        "commit": commit(),
        "silhouette": silhouette,
        "two_views": views,
        "start": {name: s._asdict() for name, s in measure_start().items()} if has_ros else None,
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


def main() -> None:
    """Measure, and replace the ratios in the files of the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=Path("docs/benchmarks.json"))
    parser.add_argument("--report", type=Path, default=Path("docs/benchmarks.md"))
    given = parser.parse_args()
    results = read_json(given.json) | {"ratios": measure_ratios(has_ros=True)}
    write_json(results, given.json)
    write_report(results, given.report)


if __name__ == "__main__":
    main()
