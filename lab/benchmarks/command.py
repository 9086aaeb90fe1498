"""``cardbox benchmark``: the speed of this machine, as a JSON file and a report."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.progress import progress_bar
from lab.benchmarks.core import measure_core
from lab.benchmarks.film import measure_films
from lab.benchmarks.nodes import measure_nodes
from lab.benchmarks.ratios import measure_ratios
from lab.benchmarks.report import PICTURE_OF_WAY, write_report
from lab.benchmarks.way import measure_way, plot_way
from lab.evaluation.results import provenance, write_json

FRAMES = 150
NODE_SECONDS = 10.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox benchmark``."""
    parser.add_argument("--json", type=Path, required=True, metavar="FILE", help="results to write")
    parser.add_argument("--report", type=Path, metavar="FILE.md", help="report to write")
    parser.add_argument(
        "--session",
        type=Path,
        metavar="SESSION",
        help="recorded session with a person for the node detector, which finds nobody in drawn "
        "images",
    )


def run(options: argparse.Namespace) -> None:
    """Measure, write the results and print a short table."""
    results = run_benchmark(options.json, options.report, session=options.session)
    print(short_table(results))
    print(f"wrote {options.json}" + (f" and {options.report}" if options.report else ""))


def run_benchmark(
    json_path: Path,
    report_path: Path | None,
    frames: int = FRAMES,
    seconds: float = NODE_SECONDS,
    session: Path | None = None,
) -> dict[str, Any]:
    """Measure everything, write ``json_path`` and, if given, the report; return the results.

    Args:
        json_path: file to write.
        report_path: Markdown file to write.
        frames: images that the estimation is measured on.
        seconds: duration of the measurement of the nodes for each stream and rate.
        session: recorded person whom the detector sees; None for the drawn one, whom it does not,
            and to leave out the film.

    Raises:
        CardboxError: a node failed or a file cannot be written.
    """
    for path in (json_path, report_path):
        if path is not None and not path.parent.is_dir():
            raise CardboxError(f"there is no folder {path.parent}; make it, or choose another")
    with progress_bar("benchmark") as show:
        core = measure_core(frames, lambda done: show(0.4 * done))
        nodes = measure_nodes(seconds, lambda done: show(0.4 + 0.5 * done), session)
        way = measure_way(seconds) if nodes else None
        ratios = measure_ratios(nodes is not None)
        film = measure_films() if session is not None else None
        show(1.0)
    results = {
        **{name: core.pop(name) for name in list(core) if not isinstance(core[name], dict)},
        **provenance(),
        "cores": len(os.sched_getaffinity(0)),
        "measured_frames": frames,
        **core,
        "ratios": ratios,
        "film": film,
        "nodes": nodes,
        "way": way,
    }
    write_json(results, json_path)
    if report_path is not None:
        if way:
            picture = report_path.parent / PICTURE_OF_WAY
            picture.parent.mkdir(exist_ok=True)
            plot_way(way, picture)
        write_report(results, report_path)
    return results


def short_table(results: dict[str, Any]) -> str:
    """Return the main figures for the terminal."""
    lines = [
        f"a frame of 600 particles, one core  {results['frame_ms_median']:.2f} ms median, "
        f"{results['frame_ms_p95']:.2f} ms p95",
        f"against OpenCV's cost               {results['ratio_opencv']:.0f} times faster",
        f"cardbox against boxes               {results['ratio_volumetric']:.1f} times faster",
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
