"""The benchmark's report in Markdown, and the README's figures of speed, from its JSON file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cardbox_tracker.benchmarks.nodes import PERCENTILES
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.files import atomic_path

BEGIN, END = "<!-- benchmark:begin -->", "<!-- benchmark:end -->"
COMMAND = "make benchmark"

_STREAM = "mono8 320x240 at 30 Hz"

_FRAMES = {
    "paper": "silhouette to posture, the paper's settings",
    "opencv": "the same with OpenCV drawing the patches",
    "default": "silhouette to posture, preset `default`",
    "image_to_posture": "image to posture, the paper's settings",
}


def write_report(results: Mapping[str, Any], path: Path) -> None:
    """Write the report of ``results``, as ``benchmark.json`` holds them, to ``path``."""
    with atomic_path(path) as temporary:
        temporary.write_text(report(results), encoding="utf-8")


def report(results: Mapping[str, Any]) -> str:
    """Return the whole report."""
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    parts = [
        "# Benchmarks",
        f"Made by `{COMMAND}` on {results['cpu']} with {results['cores']} cores; {versions}; "
        f"commit {results['commit']}. Numbers: [benchmarks.json](benchmarks.json).",
        "Everything in the first four tables is pinned to one core unless it says otherwise, and "
        f"what is compared takes turns of ten images, {results['measured_frames']} in all: a "
        "synthetic person who waves, 320x240. p95 is the 95th percentile.",
        "## A frame",
        _table(
            ("600 particles unless the preset says otherwise", "median", "p95"),
            [(_FRAMES[name], *_ms(times)) for name, times in results["frames"].items()],
        ),
        f"The compiled cost makes a frame {results['ratio_opencv']:.0f} times faster than "
        "`fillConvexPoly`, XOR and `countNonZero` do. With equal, compiled tools the box model of "
        f"42 planes takes {results['ratio_volumetric']:.1f} times as long as the cardbox with its "
        f"15. {_mediapipe(results)} The process holds {results['rss_mb']:.0f} MB.",
        "## Stages",
        _table(
            ("step of a frame", "median", "p95"),
            [(name, *_ms(times)) for name, times in results["stages"].items()],
        ),
        "## Resolution",
        "A particle costs the rows of its outline, not its area: twice the width and height cost "
        f"{results['ratio_double_resolution']:.2f} times as much.",
        _table(
            ("image", "median", "p95"),
            [(name, *_ms(times)) for name, times in results["resolutions"].items()],
        ),
        "## Particles",
        f"{results['particles_at_30hz']:,} particles a frame fit into a thirtieth of a second on "
        "two cores.",
        _table(
            ("particles in all filters", "one core", "two cores"),
            [
                (count, f"{times['cores_1_ms']:.2f} ms", f"{times['cores_2_ms']:.2f} ms")
                for count, times in results["particles"].items()
            ],
        ),
        _parallel(results["parallel_arms"]),
        *_nodes(results["nodes"]),
        "A live node waits between images, and meanwhile the processor slows down and its caches "
        "are given away: from image to posture, preset `default`, one frame takes "
        f"{results['after_pauses']['without_ms']:.1f} ms right after the other and "
        f"{results['after_pauses']['with_ms']:.1f} ms after a pause of a thirtieth of a second, on "
        "the same core. The rest of a latency is DDS and the waking of processes.",
    ]
    return "\n\n".join(parts) + "\n"


def readme_section(results: Mapping[str, Any]) -> str:
    """Return the README's table of speed."""
    rows = [
        (
            "a frame, silhouette to posture, 600 particles, one core",
            _ms(results["frames"]["paper"])[0],
        ),
        (
            "faster than drawing the same patches with OpenCV",
            f"{results['ratio_opencv']:.0f} times",
        ),
    ]
    if results["ratio_mediapipe"] is not None:
        measured = results["mediapipe"]
        rows += [
            ("faster than MediaPipe Pose (full), one core", f"{measured['ratio']:.0f} times"),
            (
                "the same with our silhouette's time counted too",
                f"{measured['ratio_from_image']:.1f} times",
            ),
        ]
    rows.append(("particles a frame at 30 Hz, two cores", f"{results['particles_at_30hz']:,}"))
    nodes = results["nodes"]
    for words, measured in (
        (("all nodes in one process", nodes["single_process"]), ("each in its own", nodes))
        if nodes
        else ()
    ):
        stream = measured["streams"][_STREAM]
        text = f"{stream['p50_ms']:.1f} ms median, {stream['p95_ms']:.1f} ms p95"
        rows.append((f"image stamp to JointState over DDS, {_STREAM}, {words}", text))
    return _table(("speed", f"on {results['cpu']}"), rows)


def _nodes(nodes: Mapping[str, Any] | None) -> list[str]:
    if nodes is None:
        return ["## Nodes", "Not measured: ROS 2 was not installed."]
    return [
        "## Nodes",
        "From the image's stamp until a subscriber's callback, in Python, has the JointState, over "
        "DDS, preset `default`; in brackets until it had arrived in the subscriber's process. The "
        "publisher shares the machine. Large images use `config/fastdds_large_images.xml`. "
        "Processor time is in percent of one core.",
        "### Each node a process of its own",
        *_streams(nodes),
        "### All nodes in one process (`cardbox_nodes`)",
        *_streams(nodes["single_process"]),
    ]


def _streams(measured: Mapping[str, Any]) -> list[str]:
    ready = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in measured["ready_s"].items())
    memory = ", ".join(f"{name} {value:.0f} MB" for name, value in measured["rss_mb"].items())
    processes = list(measured["ready_s"])
    several = len(processes) > 1
    rows = [
        (
            name,
            *(
                f"{stream[f'p{p}_ms']:.1f} ms ({stream[f'received_p{p}_ms']:.1f})"
                for p in PERCENTILES
            ),
            f"{stream['received']}/{stream['sent']}",
            *(f"{stream['cpu_percent'][process]:.0f} %" for process in processes),
            *([f"{stream['cpu_percent_sum']:.0f} %"] if several else []),
        )
        for name, stream in measured["streams"].items()
    ]
    titles = (*(f"p{p}" for p in PERCENTILES), "arrived", *processes)
    return [
        _table(("stream", *titles, *(["all three"] if several else [])), rows),
        f"Ready after: {ready} (from the start of the process, with compiled code in the cache). "
        f"Memory: {memory}.",
    ]


def _parallel(times: Mapping[str, Any]) -> str:
    parts = [
        f"{measured['parallel']['median_ms']:.2f} instead of "
        f"{measured['one after the other']['median_ms']:.2f} ms with {count} particles"
        for count, measured in times["particles"].items()
    ]
    return (
        f"With both arms at the same time on {times['cores']} cores a frame takes "
        f"{' and '.join(parts)}; the trackers do so from {TrackerConfig().parallel_from} particles "
        "an arm on."
    )


def _mediapipe(results: Mapping[str, Any]) -> str:
    measured = results["mediapipe"]
    if measured is None:
        return "MediaPipe was not installed."
    return (
        f"MediaPipe Pose, full model, takes {measured['median_ms']:.1f} ms for the same images "
        f"(it finds somebody in {100 * measured['found']:.0f} % of them): "
        f"{measured['ratio']:.0f} times as long as a frame from silhouette to posture, "
        f"{measured['ratio_from_image']:.1f} times as long as one from the image."
    )


def _ms(times: Mapping[str, float]) -> tuple[str, str]:
    return f"{times['median_ms']:.3g} ms", f"{times['p95_ms']:.3g} ms"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, *rows)]
    lines.insert(1, "|" + "---|" * len(header))
    return "\n".join(lines)
