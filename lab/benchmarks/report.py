"""The benchmark's report in Markdown, from its JSON file."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cardbox_tracker.common.files import write_file
from lab.benchmarks.nodes import PERCENTILES
from lab.evaluation.results import read_json, write_json
from lab.pages import table

COMMAND = "make benchmark"
PICTURE_OF_WAY = "images/way.png"
"""Plot of the steps of an image's way, relative to the report."""

_FRAMES = {
    "paper": "silhouette to posture, the paper's settings",
    "opencv": "the same with OpenCV drawing the patches",
    "default": "silhouette to posture, preset `default`",
    "image_to_posture": "image to posture, the paper's settings",
}


def write_report(results: Mapping[str, Any], path: Path) -> None:
    """Write the report of ``results``, as ``benchmark.json`` holds them, to ``path``."""
    write_file(path, report(results))


def replace_part(name: str, measure: Callable[[], Any], description: str | None) -> None:
    """Measure one part of the results, and replace it in the files that the command line names."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, default=Path("docs/benchmarks.json"))
    parser.add_argument("--report", type=Path, default=Path("docs/benchmarks.md"))
    given = parser.parse_args()
    results = read_json(given.json) | {name: measure()}
    write_json(results, given.json)
    write_report(results, given.report)


def report(results: Mapping[str, Any]) -> str:
    """Return the whole report."""
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    parts = [
        "# Benchmarks",
        f"`{COMMAND}` made this page on {results['cpu']} with {results['cores']} cores; "
        f"{versions}; commit {results['commit']}. "
        "[benchmarks.json](benchmarks.json) has all numbers.",
        "The first three tables were measured on one core, on "
        f"{results['measured_frames']} images (320x240) of a synthetic person who waves. The "
        "compared trackers take turns of ten images. p95 is the 95th percentile.",
        "## One image",
        table(
            ("600 particles unless the preset says otherwise", "median", "p95"),
            [(_FRAMES[name], *_ms(times)) for name, times in results["frames"].items()],
        ),
        f"The compiled cost is {results['ratio_opencv']:.0f} times faster than `fillConvexPoly`, "
        f"XOR and `countNonZero`. {_ratings(results['stages'])} The preset `default` takes "
        f"{results['ratio_default']:.1f} times as long as the paper's settings, and the "
        "volumetric model of 42 planes "
        f"{results['ratio_volumetric']:.1f} times as long as the cardbox model of 15. The process "
        f"holds {results['rss_mb']:.0f} MB.",
        "## Parts of a frame with the preset `default`",
        _stages(results["default_stages"]),
        "## Resolution and particles",
        f"Twice the width and height take {results['ratio_double_resolution']:.2f} times as long.",
        table(
            ("image", "median", "p95"),
            [(name, *_ms(times)) for name, times in results["resolutions"].items()],
        ),
        f"One core manages {results['particles_at_30hz']:,} particles per image at 30 Hz.",
        *_ratios(results.get("ratios")),
        *_film(results.get("film")),
        *_nodes(results["nodes"]),
        *_way(results["way"]),
        "In the pauses of a live node the processor slows down and its caches cool. Image to "
        "posture, preset `default`, takes "
        f"{results['after_pauses']['without_ms']:.1f} ms without pauses and "
        f"{results['after_pauses']['with_ms']:.1f} ms after each thirtieth of a second.",
    ]
    return "\n\n".join(parts) + "\n"


def _ratings(stages: Mapping[str, Mapping[str, float]]) -> str:
    """Return the time of a rating, from the steps with 200 ratings, beside that of a peer."""
    torso, *arms = (
        5.0 * stages[f"cost of all {what}"]["median_ms"]
        for what in ("torsos", "left arms", "right arms")
    )
    return (
        f"A rating takes {torso:.1f} us (torso) or {sum(arms) / 2:.1f} us (arm). OpenCV is a weak "
        "opponent. `bodytrack` of the PARSEC suite, an annealed filter of cylinders in C++, took "
        "2.5 to 2.8 us a rating of one camera of 320x240, and this package beside it 1.65 to 2.0 "
        "us; this was measured once, outside the repository."
    )


def _ratios(ratios: Mapping[str, Any] | None) -> list[str]:
    if ratios is None:
        return []
    silhouette = ratios["silhouette"]
    without = silhouette["ratios_without"]
    rows = [
        ("silhouette with all steps / by brightness alone", f"{silhouette['ratio']:.2f}"),
        *((f"without {name} / by brightness alone", f"{of:.2f}") for name, of in without.items()),
        ("a frame with two cameras / with one, preset `default`", f"{ratios['two_views']:.2f}"),
        *(
            (f"start of `{name}` ({start['seconds']:.2f} s) / imports", f"{start['ratio']:.1f}")
            for name, start in (ratios["start"] or {}).items()
        ),
        (
            "`cardbox track FOLDER` of eight recordings with one process / with two",
            f"{ratios['folder']:.2f}",
        ),
    ]
    return [
        "## Ratios",
        f"`python -m lab.benchmarks.ratios` (commit {ratios['commit']}) measures times in turns, "
        "on one core except the last. A start lasts until all nodes of a process wait for their "
        "input, with compiled code in the cache; `imports` are those of rclpy, numba, OpenCV and "
        "numpy.",
        table(("ratio", "median"), rows),
    ]


def _film(film: Mapping[str, Any] | None) -> list[str]:
    if film is None:
        return []
    runs = [run for run in film if run not in ("commit", "load")]
    steps = [film[run]["steps_ms"] for run in runs]
    totals = [sum(one.values()) for one in steps]
    rows = [
        (
            step,
            *(
                f"{one[step]:.1f} ms, {one[step] / total:.0%}" if one[step] else ""
                for one, total in zip(steps, totals, strict=True)
            ),
        )
        for step in steps[0]
    ]
    rows.append(("all", *(f"{total:.1f} ms" for total in totals)))
    rows.append(("images a second, all in all", *(f"{film[run]['hz']:.1f}" for run in runs)))
    return [
        "## A film",
        f"`python -m lab.benchmarks.film` (commit {film['commit']}) tracks the film of `cardbox "
        "demo`, enlarged to 1280x960, or twice side by side in 1280x480, with the detector. "
        "Processor time an image and its share, with compiled code loaded; a thread decodes, one "
        "resizes, one detects, and one draws and encodes, beside the one that does the rest. Hands "
        "and video need large images, so that film is decoded twice. The load of the machine was "
        f"{film['load']:.1f}; above the number of cores, times are longer than on a quiet one.",
        table(("step", *runs), rows),
    ]


def _nodes(nodes: Mapping[str, Any] | None) -> list[str]:
    if nodes is None:
        return ["## Nodes", "Not measured: ROS 2 was not installed."]
    return [
        "## Nodes",
        "Time from the image's stamp until the callback of a Python subscriber has the JointState, "
        "over DDS on one machine, preset `default`; in brackets until the message is in its "
        "process. Processor time is in percent of one core.",
        "### Each node a process of its own",
        *_streams(nodes),
        "### All nodes in one process (`cardbox_nodes`)",
        *_streams(nodes["single_process"]),
        *_beside_detector(nodes.get("with_detector"), "of_detector" in nodes),
        *_of_detector(nodes.get("of_detector")),
        *_with_robot(nodes),
    ]


def _way(ways: Mapping[str, Any] | None) -> list[str]:
    if not ways:
        return []
    rows = [
        (
            step,
            *(
                f"{measured[step]['p50_ms']:.2f} ms, {measured[step]['p95_ms']:.2f} ms"
                for measured in ways.values()
            ),
        )
        for step in next(iter(ways.values()))
    ]
    return [
        "### Where the milliseconds are",
        "Grey images of 320x240 at 30 Hz; median and 95th percentile of each step.",
        table(("step", *ways), rows),
        f"![Medians of the steps]({PICTURE_OF_WAY})",
    ]


def _beside_detector(measured: Mapping[str, Any] | None, sees_person: bool) -> list[str]:
    if measured is None:
        return []
    seen = (
        "The images show a person whom the networks find. *Points*: images whose own points came "
        "before their joint states; the others are tracked with those of an image before."
        if sees_person
        else "The networks find nobody in the drawn images, so they take less time than with a "
        "real person."
    )
    return [
        "### Beside the node `detector`",
        f"The tracker takes the detector's [points](detectors.md) when they come. {seen}",
        *_streams(measured),
    ]


def _of_detector(measured: Mapping[str, Any] | None) -> list[str]:
    if measured is None:
        return []
    return [
        "### With the silhouettes of the node `detector`",
        "An image waits for its own points; images that come meanwhile are left out.",
        *_streams(measured),
    ]


def _with_robot(nodes: Mapping[str, Any]) -> list[str]:
    ways = {"background": nodes.get("with_robot"), "detector": nodes.get("detector_with_robot")}
    rows = [
        (
            way,
            name,
            *(f"{stream[f'{what}p{p}_ms']:.1f} ms" for what in ("", "command_") for p in (50, 95)),
            f"{stream['received']}/{stream['sent']}",
        )
        for way, measured in ways.items()
        if measured is not None
        for name, stream in measured["streams"].items()
    ]
    if not rows:
        return []
    titles = "silhouettes", "stream", "joint states p50", "p95", "command p50", "p95", "arrived"
    return [
        "### Up to the command to a robot",
        "The node `retarget` moves the [example arm](retargeting.md); time from the image's stamp "
        "until it has sent its command.",
        table(titles, rows),
    ]


def _streams(measured: Mapping[str, Any]) -> list[str]:
    ready = ", ".join(f"{name} {seconds:.1f} s" for name, seconds in measured["ready_s"].items())
    memory = ", ".join(f"{name} {value:.0f} MB" for name, value in measured["rss_mb"].items())
    processes = list(measured["ready_s"])
    several = len(processes) > 1
    has_points = any(stream.get("points") for stream in measured["streams"].values())
    rows = [
        (
            name,
            *(
                f"{stream[f'p{p}_ms']:.1f} ms ({stream[f'received_p{p}_ms']:.1f})"
                for p in PERCENTILES
            ),
            f"{stream['received']}/{stream['sent']}",
            *([f"{stream['points']}"] if has_points else []),
            *(f"{stream['cpu_percent'][process]:.0f} %" for process in processes),
            *([f"{stream['cpu_percent_sum']:.0f} %"] if several else []),
        )
        for name, stream in measured["streams"].items()
    ]
    titles = (*(f"p{p}" for p in PERCENTILES), "arrived")
    titles = (*titles, *(["points"] if has_points else []), *processes)
    return [
        table(
            (
                "stream",
                *titles,
                *(["all three" if len(processes) == 3 else "all"] if several else []),
            ),
            rows,
        ),
        f"Ready after: {ready} (from the start of the process, with compiled code in the cache). "
        f"Memory: {memory}.",
    ]


def _stages(stages: Mapping[str, Mapping[str, float]]) -> str:
    rows = [(name, *_ms(times)) for name, times in stages.items()]
    return table(("step", "median", "p95"), rows)


def _ms(times: Mapping[str, float]) -> tuple[str, str]:
    return f"{times['median_ms']:.3g} ms", f"{times['p95_ms']:.3g} ms"
