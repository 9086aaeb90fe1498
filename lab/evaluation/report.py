"""``sessions.md``: results of the tracker on recorded sessions, in tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

Results = Mapping[str, Any]
"""The contents of ``sessions.json``."""

MOTION_CAPTURE = "cmu"
"""Sessions with this in their name have motions from motion capture."""

DEVELOPMENT = frozenset(
    {
        *("person_a", "person_b", "cmu_gestures", "cmu_everyday_30fps", "cmu_conversation"),
        *("arms_before_torso", "leaves_returns_elsewhere", "steps_and_turns", "changing_light"),
        *("low_contrast_child", "fast_waving_side_object", "two_webcams", "stereo_bumblebee"),
    }
)
"""Rendered sessions on which settings of the package were chosen."""


def sessions_report(results: Results) -> str:
    """Return the report in Markdown."""
    seeds = ", ".join(map(str, results["seeds"]))
    lines = [
        "# Recorded sessions with ground truth",
        "",
        f"Preset `{results['preset']}`, means over the seeds {seeds}. Each session is initialized "
        "from its own reference postures with silhouettes of the background model; images with the "
        "neck in view after them are scored.",
        "",
        *_used_in_development([session["name"] for session in results["sessions"]]),
        *_versus(results),
        *_steadiness(results),
        *_recovery(results),
        *_lengths(results),
        f"Made by `{results['command']}` at commit {results['provenance']['commit']} on "
        f"{results['provenance']['cpu']}.",
    ]
    return "\n".join(lines) + "\n"


def _used_in_development(names: Sequence[str]) -> list[str]:
    """Return a paragraph about the sessions that settings were chosen on, if there are any."""
    used = [name for name in names if name in DEVELOPMENT]
    if not used:
        return []
    which = "all sessions" if len(used) == len(names) else ", ".join(used)
    return [
        f"Settings of the package were chosen on {which}, which were thus used in development. No "
        "network was trained on them, but constants of a detector's points and the probabilities "
        "behind the states were fitted to them; [doubt](doubt.md) has the states of sources that "
        "were left out. Their bodies (MakeHuman, CC0) and rooms are rendered, their motions "
        "scripted or motion capture (sessions named `cmu`, `two_webcams`), of which the prior of "
        "the arms learned other clips. The data used in this project was obtained from "
        "mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217.",
        "",
    ]


def mean_of(runs: Sequence[Mapping[str, Any]], *path: str) -> float:
    """Return the mean of a figure over the runs that have it; nan if none has."""
    values = []
    for run in runs:
        value: Any = run
        for key in path:
            value = value.get(key) if isinstance(value, Mapping) else None
        if isinstance(value, int | float) and np.isfinite(value):
            values.append(float(value))
    return float(np.mean(values)) if values else float("nan")


def _versus(results: Results) -> list[str]:
    """Return the table of errors, compared with MediaPipe's."""
    columns: dict[str, Callable[[Results], float]] = {
        "absolute": lambda s: mean_of(s["runs"], "absolute"),
        "aligned": lambda s: mean_of(s["runs"], "aligned"),
        "MediaPipe aligned": lambda s: s["mediapipe"].get("aligned", float("nan")),
        "PA": lambda s: mean_of(s["runs"], "pa"),
        "MediaPipe PA": lambda s: s["mediapipe"].get("pa", float("nan")),
        "aligned shoulders": lambda s: mean_of(s["runs"], "aligned_shoulder"),
        "aligned elbows": lambda s: mean_of(s["runs"], "aligned_elbow"),
        "aligned hands": lambda s: mean_of(s["runs"], "aligned_hand"),
    }
    lines = [
        "## Errors, cm",
        "",
        "Mean 3D distance of shoulders, elbows and hands. *Aligned*: after both skeletons are "
        "shifted to the middle of their shoulders; *PA*: after the best similarity transform. "
        "MediaPipe Pose (full) gives no metric position, so it has no absolute error.",
        "",
        *_table(results, columns, "{:.1f}"),
    ]
    compared = [
        (s["name"], mean_of(s["runs"], "aligned") / s["mediapipe"]["aligned"])
        for s in results["sessions"]
        if "aligned" in s["mediapipe"] and np.isfinite(mean_of(s["runs"], "aligned"))
    ]
    if compared:
        better = [name for name, ratio in compared if ratio < 1]
        worst = max(compared, key=lambda pair: pair[1])
        lines += [
            f"Aligned error below MediaPipe's on {len(better)} of {len(compared)} sessions; the "
            f"largest ratio is {worst[1]:.2f} ({worst[0]}).",
            "",
        ]
    failures = {
        s["name"]: run["failure"]
        for s in results["sessions"]
        for run in s["runs"]
        if run.get("failure")
    }
    lines += [f"- `{name}` was not initialized: {text}" for name, text in failures.items()]
    return [*lines, ""] if failures else lines


def _steadiness(results: Results) -> list[str]:
    columns: dict[str, Callable[[Results], float]] = {
        "acceleration error, m/s²": lambda s: mean_of(s["runs"], "acceleration"),
        "beside the shoulders": lambda s: mean_of(s["runs"], "acceleration_beside"),
        "without estimate, %": lambda s: _percent(s, "without_estimate"),
        "beyond 30 cm, %": lambda s: _percent(s, "far"),
        "images beyond 30 cm that are `tracking`, per run": lambda s: mean_of(
            s["runs"], "far_but_tracking"
        ),
        "coverage: mean, %": lambda s: _coverage(s, np.mean),
        "least, %": lambda s: _coverage(s, np.min),
        "most, %": lambda s: _coverage(s, np.max),
        "ms an image": lambda s: mean_of(s["runs"], "ms"),
        "MediaPipe ms": lambda s: s["mediapipe_ms"] or float("nan"),
    }
    return [
        "## Steadiness, losses, uncertainty, time",
        "",
        "Coverage: share of images in which the true angle of a joint lies within two standard "
        "deviations, over the 11 angles. The acceleration error is that of the joints' positions, "
        "and of those relative to the middle of the shoulders. MediaPipe was timed in another run.",
        "",
        *_table(results, columns, "{:.1f}"),
    ]


def _lengths(results: Results) -> list[str]:
    columns: dict[str, Callable[[Results], float]] = {
        name: partial(_figure, path=("lengths", key))
        for name, key in (
            ("upper arm", "upper_arm"),
            ("forearm to hand", "forearm"),
            ("shoulder breadth", "shoulders"),
            ("shoulder joints too high, cm", "joint_height"),
        )
    }
    return [
        "## Measured lengths, as a ratio to the true ones",
        "",
        "The height of the shoulder joints is compared while the arms hang.",
        "",
        *_table(results, columns, ("{:.3f}", "{:.3f}", "{:.3f}", "{:+.1f}")),
        *_deviations(results, columns),
    ]


def _deviations(results: Results, columns: Mapping[str, Callable[[Results], float]]) -> list[str]:
    """Return a sentence with the mean and the largest deviation of each length, or nothing."""
    table = np.array([[column(s) for column in columns.values()] for s in results["sessions"]])
    measured = table[np.isfinite(table).all(axis=1)]
    if not measured.size:
        return []
    *ratios, height = np.abs(measured - (1.0, 1.0, 1.0, 0.0)).T
    texts = [
        f"{name} {100 * off.mean():.1f} % ({100 * off.max():.1f} %)"
        for name, off in zip(columns, ratios, strict=False)
    ]
    joints = f"shoulder joints {height.mean():.1f} cm ({height.max():.1f} cm)"
    return [f"Mean (largest) deviation: {', '.join(texts)}, {joints}.", ""]


def _recovery(results: Results) -> list[str]:
    """Return the table of recoveries; empty if they were not measured."""
    kinds = dict.fromkeys(
        kind for s in results["sessions"] for run in s["runs"] for kind in run.get("recovery", {})
    )
    if not kinds:
        return []
    lines = [
        "## Recovery after disturbances",
        "",
        "Recovered trials, and in brackets all, with the first seed. Recovered: the mean error "
        "from half a second to one second after the disturbance is at most 4 cm above that of the "
        "undisturbed run, or below 10 cm.",
        "",
        f"| session | {' | '.join(kinds)} |",
        "|---" * (len(kinds) + 1) + "|",
    ]
    totals = {kind: np.zeros(2, int) for kind in kinds}
    for session in results["sessions"]:
        cells = []
        for kind in kinds:
            trials = [r["recovery"][kind] for r in session["runs"] if "recovery" in r]
            pairs = [(t["recovered"], t["trials"]) for t in trials]
            counts = np.array(pairs, int).reshape(-1, 2)
            totals[kind] += counts.sum(axis=0)
            cells.append("{} ({})".format(*counts.sum(axis=0)))
        lines.append(f"| {session['name']} | {' | '.join(cells)} |")
    cells = ["{} ({})".format(*total) for total in totals.values()]
    return [*lines, f"| **all** | {' | '.join(cells)} |", ""]


def _figure(session: Results, path: tuple[str, ...]) -> float:
    return mean_of(session["runs"], *path)


def _percent(session: Results, key: str) -> float:
    return 100 * mean_of(session["runs"], key) / max(mean_of(session["runs"], "frames"), 1)


def _coverage(session: Results, summary: Callable[[list[float]], Any]) -> float:
    names = dict.fromkeys(n for run in session["runs"] for n in run.get("coverage", {}))
    values = [mean_of(session["runs"], "coverage", name) for name in names]
    return 100 * float(summary(values)) if values else float("nan")


def _table(
    results: Results,
    columns: Mapping[str, Callable[[Results], float]],
    form: str | tuple[str, ...],
) -> list[str]:
    """Return a table of sessions, with means over all and over those with motion capture.

    ``form`` is the format of all columns, or one format for each column.
    """
    forms = (form,) * len(columns) if isinstance(form, str) else form
    sessions = results["sessions"]
    values = {s["name"]: [column(s) for column in columns.values()] for s in sessions}
    lines = [f"| session | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    lines += [_row(name, row, forms) for name, row in values.items()]
    groups = {f"mean of {len(sessions)}": list(values)}
    captured = [name for name in values if MOTION_CAPTURE in name]
    if 0 < len(captured) < len(values):
        groups[f"motion capture ({len(captured)})"] = captured
    for label, names in groups.items():
        rows = np.array([values[name] for name in names])
        means = [float(np.nanmean(c)) if np.isfinite(c).any() else float("nan") for c in rows.T]
        lines.append(_row(f"**{label}**", means, forms))
    return [*lines, ""]


def _row(name: str, values: Iterable[float], forms: Iterable[str]) -> str:
    cells = [
        form.format(value) if np.isfinite(value) else ""
        for value, form in zip(values, forms, strict=True)
    ]
    return f"| {name} | {' | '.join(cells)} |"
