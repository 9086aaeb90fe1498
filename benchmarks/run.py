"""``cardbox benchmark``: the speed of this machine, as a JSON file and a report."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from benchmarks.core import measure_core
from benchmarks.mediapipe import measure_mediapipe
from benchmarks.nodes import measure_nodes
from benchmarks.report import write_report
from benchmarks.scene import make_scene
from benchmarks.tools import pinned
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.evaluation.results import provenance, write_json
from cardbox_tracker.progress import progress_bar

FRAMES = 150
NODE_SECONDS = 10.0


def run_benchmark(
    json_path: Path, report_path: Path | None, frames: int = FRAMES, seconds: float = NODE_SECONDS
) -> dict[str, Any]:
    """Measure everything, write ``json_path`` and, if given, the report; return the results.

    Args:
        json_path: file to write.
        report_path: Markdown file to write.
        frames: images that the estimation is measured on.
        seconds: how long the nodes are measured with each stream and rate.

    Raises:
        CardboxError: a node failed or a file cannot be written.
    """
    for path in (json_path, report_path):
        if path is not None and not path.parent.is_dir():
            raise CardboxError(f"there is no folder {path.parent}; make it, or choose another")
    with progress_bar("benchmark") as show:
        core = measure_core(frames, lambda done: show(0.4 * done))
        mediapipe = _mediapipe(frames, core)
        show(0.45)
        nodes = measure_nodes(seconds, lambda done: show(0.45 + 0.55 * done))
    results = {
        **{name: core.pop(name) for name in list(core) if not isinstance(core[name], dict)},
        "ratio_mediapipe": mediapipe["ratio"] if mediapipe else None,
        **provenance(),
        "cores": len(os.sched_getaffinity(0)),
        "measured_frames": frames,
        **core,
        "mediapipe": mediapipe,
        "nodes": nodes,
    }
    write_json(results, json_path)
    if report_path is not None:
        write_report(results, report_path)
    return results


def _mediapipe(frames: int, core: dict[str, Any]) -> dict[str, float] | None:
    """Compare with MediaPipe on the same images, by the estimation alone and from the image."""
    with pinned(1):
        measured = measure_mediapipe(make_scene(320, 240, frames, 2).images)
    if measured is None:
        return None
    median = measured["median_ms"]
    return {
        **measured,
        "ratio": median / core["frame_ms_median"],
        "ratio_from_image": median / core["frames"]["image_to_posture"]["median_ms"],
    }


def short_table(results: dict[str, Any]) -> str:
    """Return the main figures for the terminal."""
    lines = [
        f"a frame of 600 particles, one core  {results['frame_ms_median']:.2f} ms median, "
        f"{results['frame_ms_p95']:.2f} ms p95",
        f"against OpenCV's cost               {results['ratio_opencv']:.0f} times faster",
        f"cardbox against boxes               {results['ratio_volumetric']:.1f} times faster",
        f"against MediaPipe Pose              {_times(results['ratio_mediapipe'])}",
        f"twice the width and height          {results['ratio_double_resolution']:.2f} as long",
        f"particles at 30 Hz, one core        {results['particles_at_30hz']}",
        f"memory                              {results['rss_mb']:.0f} MB",
    ]
    nodes = results["nodes"]
    if nodes:
        lines += ["each node a process of its own:", *_streams(nodes["streams"])]
        lines += ["all nodes in one process:", *_streams(nodes["single_process"]["streams"])]
    return "\n".join(lines)


def _streams(streams: dict[str, Any]) -> list[str]:
    return [
        f"  {name:33} {stream['p50_ms']:.1f} ms median, {stream['p95_ms']:.1f} ms p95, "
        f"{stream['cpu_percent_sum']:.0f} % of a core, {stream['received']}/{stream['sent']}"
        for name, stream in streams.items()
    ]


def _times(ratio: float | None) -> str:
    return "not installed" if ratio is None else f"{ratio:.0f} times faster"
