"""Memory, files, threads and latency of a long run over time, as a file, a table and a picture."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.common.files import write_file
from lab.evaluation.results import provenance, read_json, write_json
from lab.pages import plot, table

PERCENTILES = (50, 95, 99, 100)


class Resources(NamedTuple):
    """Resources of one process: resident memory in MB, open files and threads."""

    memory_mb: float
    files: int
    threads: int


def resources_of(pid: int) -> Resources:
    """Return the resources of a running process.

    Raises:
        OSError: there is no such process.
    """
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    status = dict(line.split(":", 1) for line in lines)
    files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    return Resources(int(status["VmRSS"].split()[0]) / 1000, files, int(status["Threads"]))


@dataclass
class Record:
    """Samples of one run, written after each of them, so that an interrupted run keeps them.

    Attributes:
        path: the file.
        run: name of the run.
        about: what was run, in words.
        wanted: number of images or seconds that the run was to reach.
        unit: ``images`` or ``s``.
        counts: what happened, by a few words.
        samples: time, images, latency and resources of each process, in order.
        made_by: versions, commit and processor at the start.
    """

    path: Path
    run: str
    about: str
    wanted: float
    unit: str
    counts: Counter[str] = field(default_factory=Counter)
    samples: list[dict[str, Any]] = field(default_factory=list)
    made_by: dict[str, Any] = field(default_factory=provenance)

    def add(
        self,
        passed_s: float,
        images: int,
        took_s: Sequence[float],
        resources: Mapping[str, Resources],
        **more: float | None,
    ) -> None:
        """Add a sample and write the file.

        Args:
            passed_s: seconds since the start.
            images: number of images since the start.
            took_s: latency of each image since the sample before, seconds.
            resources: those of each process.
            more: further numbers of this sample.
        """
        ms = 1000 * np.percentile(took_s, PERCENTILES) if len(took_s) else [float("nan")] * 4
        latency = {
            f"p{share}_ms": float(value) for share, value in zip(PERCENTILES, ms, strict=True)
        }
        processes = {name: one._asdict() for name, one in resources.items()}
        sample = {"passed_s": passed_s, "images": images, **latency, **more}
        self.samples.append({**sample, "processes": processes})
        write_json(
            {
                "run": self.run,
                "about": self.about,
                "wanted": self.wanted,
                "unit": self.unit,
                "counts": dict(self.counts),
                **self.made_by,
                "samples": self.samples,
            },
            self.path,
        )


_PAGE = """\
# Endurance

Long runs, with memory, open files, threads and latency over time. Each run is one command:
`python -m lab.tools.endurance day`, `hour` or `eight`; it writes this page again, also when it is
interrupted. Other programs ran on the same machine. The first quarter of each run is compared with
the last one; memory is the mean of a quarter.

![Memory and latency](../images/endurance.png)

*Memory of each process and latency over time.*
"""
_VALUES = {
    "p50_ms": "latency, median, ms",
    "p99_ms": "latency, 99th percentile, ms",
    "iou": "overlap with the image",
    "error_cm": "error of the keypoints, cm",
}
_HEAD = (
    *("process", "memory, MB, first and last quarter"),
    *("files, first and last", "threads, first and last"),
)


def _quarters(samples: Sequence[Mapping[str, Any]]) -> tuple[Any, Any]:
    """Return the first and the last quarter; the first sample, during the start, is left out."""
    used = samples[1:] or samples
    size = max(1, len(used) // 4)
    return used[:size], used[-size:]


def _mean(samples: Sequence[Mapping[str, Any]], key: str) -> float:
    known = [sample[key] for sample in samples if sample[key] is not None]
    return float(np.mean(known)) if known else float("nan")


def section_of(data: Mapping[str, Any]) -> str:
    """Return the Markdown of one run, from its file's data."""
    samples, counts = data["samples"], data["counts"]
    first, last = _quarters(samples)
    end = samples[-1]
    reached = end["images"] if data["unit"] == "images" else end["passed_s"]
    short = f", of {data['wanted']:,.0f} {data['unit']} wanted" if reached < data["wanted"] else ""
    values = [
        (words, f"{_mean(first, key):.3g}", f"{_mean(last, key):.3g}")
        for key, words in _VALUES.items()
        if key in end
    ]
    processes = []
    for name in end["processes"]:
        early, late = ([s["processes"][name] for s in part] for part in (first, last))
        cells = [f"{_mean(early, 'memory_mb'):.1f}, {_mean(late, 'memory_mb'):.1f}"]
        cells += [f"{early[0][key]}, {late[-1][key]}" for key in ("files", "threads")]
        processes.append((name, *cells))
    parts = [
        f"## {data['run']}",
        f"{data['about']} Reached: {end['images']:,} images in {end['passed_s'] / 60:.0f} "
        f"minutes{short}.",
        "\n".join(f"- {text}: {number:,}" for text, number in counts.items()),
        table(("value", "first quarter", "last quarter"), values),
        table(_HEAD, processes),
    ]
    return "\n\n".join(parts) + "\n"


def draw(runs: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Write a PNG with memory and latency over time, a row for each run."""
    with plot(path, (len(runs), 2), (10, 2.6 * len(runs))) as grid:
        for (memory, latency), data in zip(grid, runs, strict=True):
            samples = data["samples"]
            minutes = [sample["passed_s"] / 60 for sample in samples]
            for name in samples[-1]["processes"]:
                used = [sample["processes"][name]["memory_mb"] for sample in samples]
                memory.plot(minutes, used, label=name)
            for share in PERCENTILES[:-1]:
                took = [sample[f"p{share}_ms"] for sample in samples]
                latency.plot(minutes, took, label=f"{share} %")
            for axis, what, unit in ((memory, "memory", "MB"), (latency, "latency", "ms")):
                axis.set(title=f"{data['run']}: {what}", ylabel=unit, xlabel="minutes")
                # A flat line would otherwise lie on the frame.
                axis.set_ylim(0.0, 1.2 * axis.get_ylim()[1])
                axis.legend(fontsize="x-small", loc="lower right")


def write_page(folder: Path, image: Path) -> None:
    """Write endurance.md in ``folder`` and the picture ``image`` from the runs' files there."""
    runs = [read_json(path) for path in sorted(folder.glob("endurance-*.json"))]
    draw(runs, image)
    page = folder / "endurance.md"
    write_file(page, "\n".join([_PAGE, *map(section_of, runs)]))
    print(f"written: {page} and {image}")
