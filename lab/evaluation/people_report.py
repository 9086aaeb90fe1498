"""``real-people.md``: results of the tracker on sessions of real people, in tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from lab.evaluation.people import BEYOND_CM
from lab.evaluation.report import mean_of


def replaced(text: str, section: str, begin: str, end: str) -> str:
    """Return the document ``text`` with another ``section`` between its marks.

    Raises:
        CardboxError: the marks are not there, each once.
    """
    if text.count(begin) != 1 or text.count(end) != 1:
        raise CardboxError(f"the document needs the marks {begin} and {end}, each once")
    before, rest = text.split(begin)
    return f"{before}{begin}\n{section}\n{end}{rest.split(end)[1]}"


FloatArray = NDArray[np.float64]
Entry = Mapping[str, Any]
"""One session in ``real-people.json``, tracked in one way."""

BEGIN, END = "<!-- evaluate:begin -->", "<!-- evaluate:end -->"

_INPUTS = ("cameras", "silhouettes", "points")


def people_report(results: Mapping[str, Any], document: str = "") -> str:
    """Return the report in Markdown.

    Args:
        results: the contents of ``real-people.json``.
        document: the present document. If the marks ``BEGIN`` and ``END`` are in it, only the part
            between them is replaced.
    """
    figures = "\n".join(_figures(results))
    try:
        return replaced(document, figures, BEGIN, END)
    except CardboxError:
        return f"# Real people\n\n{BEGIN}\n{figures}\n{END}\n"


def over_seeds(entries: Sequence[Entry], key: str) -> FloatArray:
    """Return a figure for each seed (s,), as a mean over the sessions; nan where one has none."""
    rows = [[_number(run.get(key)) for run in entry["runs"]] for entry in entries]
    # A session that failed as a whole has one run only.
    return np.array([np.mean(seed) for seed in zip(*rows, strict=False)])


def _figures(results: Mapping[str, Any]) -> list[str]:
    seeds = ", ".join(map(str, results["seeds"]))
    entries: list[Entry] = results["sessions"]
    return [
        f"Preset `{results['preset']}`, means over the seeds {seeds}. Nobody was measured: "
        "stature, distance and the camera's pitch are given. The reference is triangulated from "
        "several cameras and good to 2 to 3 cm a joint.",
        "",
        *_errors(entries),
        *_states(entries),
        *_failures(entries),
        *_sources(entries),
        f"Made by `{results['command']}` at commit {results['provenance']['commit']} on "
        f"{results['provenance']['cpu']}.",
    ]


def _errors(entries: Sequence[Entry]) -> list[str]:
    columns: dict[str, Callable[[Sequence[Entry]], str]] = {
        "absolute": lambda group: _text(_mean(group, "absolute")),
        "aligned": lambda group: _text(_mean(group, "aligned")),
        "spread": lambda group: _text(_spread(group, "aligned")),
        "MediaPipe aligned": lambda group: _text(
            float(np.mean([_number(entry["mediapipe"].get("aligned")) for entry in group]))
        ),
        "PA": lambda group: _text(_mean(group, "pa")),
        "aligned shoulders": lambda group: _text(_mean(group, "aligned_shoulder")),
        "aligned elbows": lambda group: _text(_mean(group, "aligned_elbow")),
        "aligned hands": lambda group: _text(_mean(group, "aligned_hand")),
        "shoulders' depth": lambda group: _text(_mean(group, "shoulder_depth"), "{:+.1f}"),
        "hands' depth": lambda group: _text(_mean(group, "hand_depth"), "{:+.1f}"),
    }
    return [
        "## Errors, cm",
        "",
        "Mean 3D distance of shoulders, elbows and hands. *Aligned*: after both skeletons are "
        "shifted to the middle of their shoulders; *spread*: largest minus smallest aligned error "
        "of a seed; *PA*: after the best similarity transform; *depth*: estimate minus reference. "
        "MediaPipe Pose (heavy) has the images of the first camera alone.",
        "",
        *_table(entries, columns),
    ]


def _states(entries: Sequence[Entry]) -> list[str]:
    columns: dict[str, Callable[[Sequence[Entry]], str]] = {
        "images": lambda group: _text(_mean(group, "frames"), "{:.0f}"),
        "with estimate, %": lambda group: _text(
            100 - _share(group, "without_estimate", "frames"), "{:.0f}"
        ),
        "`tracking`, %": lambda group: _text(_share(group, "tracking", "frames"), "{:.0f}"),
    }
    columns |= {
        f"of these beyond {limit_cm} cm, %": partial(_beyond, limit_cm=limit_cm)
        for limit_cm in BEYOND_CM
    }
    columns |= {
        "coverage, %": lambda group: _text(_coverage(group), "{:.0f}"),
        "ms": lambda group: _text(_mean(group, "ms")),
        "input ms": lambda group: _text(_mean(group, "input_ms")),
    }
    return [
        "## States, uncertainty, time",
        "",
        "Beyond: a joint is more than 20 or 30 cm off (not aligned). Coverage: share of the images "
        "in which an angle lies within two standard deviations of the reference, over the 11 "
        "angles. *ms* is the processor time from silhouettes to posture, *input ms* that of "
        "decoding, silhouettes and points.",
        "",
        *_table(entries, columns),
    ]


def _failures(entries: Sequence[Entry]) -> list[str]:
    failures = {
        f"`{entry['name']}` ({', '.join(_inputs(entry))}) has no figures: {run['failure']}": None
        for entry in entries
        for run in entry["runs"]
        if run.get("failure")
    }
    return [*(f"- {text}" for text in failures), ""] if failures else []


def _sources(entries: Sequence[Entry]) -> list[str]:
    sources: dict[str, list[str]] = {}
    for entry in entries:
        names = sources.setdefault(entry["source"], [])
        if entry["name"] not in names:
            names.append(entry["name"])
    sources.pop("", None)
    lines = [f"- {', '.join(f'`{name}`' for name in names)}: {of}" for of, names in sources.items()]
    return ["Sources and licences of the recordings:", "", *lines, ""] if lines else []


def _table(
    entries: Sequence[Entry], columns: Mapping[str, Callable[[Sequence[Entry]], str]]
) -> list[str]:
    """Return a table with a row for each entry, and one for each group with the same inputs."""
    lines = [
        f"| session | {' | '.join((*_INPUTS, *columns))} |",
        "|---" * (1 + len(_INPUTS) + len(columns)) + "|",
    ]
    groups: dict[tuple[str, ...], list[Entry]] = {}
    for entry in entries:
        groups.setdefault((entry["group"], *_inputs(entry)), []).append(entry)
        lines.append(_row(entry["name"], [entry], columns))
    for (name, *_), group in groups.items():
        if len(group) > 1:
            lines.append(_row(f"**mean of {len(group)} in {name}**", group, columns))
    return [*lines, ""]


def _row(
    name: str,
    group: Sequence[Entry],
    columns: Mapping[str, Callable[[Sequence[Entry]], str]],
) -> str:
    cells = [name, *_inputs(group[0]), *(column(group) for column in columns.values())]
    return f"| {' | '.join(cells)} |"


def _inputs(entry: Entry) -> tuple[str, ...]:
    cameras = " ".join(entry["cameras"]) or "one"
    return cameras, entry["silhouettes"], entry["points"]


def _mean(group: Sequence[Entry], key: str) -> float:
    return float(np.mean(over_seeds(group, key)))


def _spread(group: Sequence[Entry], key: str) -> float:
    values = over_seeds(group, key)
    return float(np.ptp(values)) if len(values) > 1 else float("nan")


def _share(group: Sequence[Entry], part: str, whole: str) -> float:
    """Return a percentage over all images of a group."""
    total = sum(_number(run.get(whole)) for entry in group for run in entry["runs"])
    return (
        100 * sum(_number(run.get(part)) for entry in group for run in entry["runs"]) / total
        if total
        else float("nan")
    )


def _beyond(group: Sequence[Entry], limit_cm: int) -> str:
    return _text(_share(group, f"tracking_beyond_{limit_cm}", "tracking"), "{:.0f}")


def _coverage(group: Sequence[Entry]) -> float:
    """Return the mean over the angles, in percent."""
    runs = [run for entry in group for run in entry["runs"]]
    names = dict.fromkeys(name for run in runs for name in run.get("coverage", {}))
    values = [mean_of(runs, "coverage", name) for name in names]
    return 100 * float(np.mean(values)) if values else float("nan")


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _text(value: float, form: str = "{:.1f}") -> str:
    return form.format(value) if np.isfinite(value) else ""
