"""``sessions.md`` and ``real-people.md``: results on recorded sessions, in tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from lab.evaluation.people import BEYOND_CM
from lab.pages import number, replaced, table

Results = Mapping[str, Any]
"""The contents of ``sessions.json`` or ``real-people.json``."""
Entry = Mapping[str, Any]
"""One session in them, tracked in one way."""
Columns = Mapping[str, Callable[[Sequence[Entry]], str]]
"""Text of a group of sessions by the heading of its column."""

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
BEGIN, END = "<!-- evaluate:begin -->", "<!-- evaluate:end -->"

_LENGTHS = {
    "upper arm": "upper_arm",
    "forearm to hand": "forearm",
    "shoulder breadth": "shoulders",
    "shoulder joints too high, cm": "joint_height",
}


def sessions_report(results: Results) -> str:
    """Return the report of sessions with reference postures in Markdown."""
    parts = [
        "# Recorded sessions with ground truth",
        f"Preset `{results['preset']}`, means over the seeds "
        f"{', '.join(map(str, results['seeds']))}. Each session is initialized from its own "
        "reference postures with silhouettes of the background model; images with the neck in "
        "view after them are scored.",
        *_used_in_development([session["name"] for session in results["sessions"]]),
        *_versus(results["sessions"]),
        *_steadiness(results["sessions"]),
        *_recovery(results["sessions"]),
        *_lengths(results["sessions"]),
        _made(results),
    ]
    return "\n\n".join(parts) + "\n"


def people_report(results: Results, document: str = "") -> str:
    """Return the report of sessions of real people in Markdown.

    Args:
        results: the contents of ``real-people.json``.
        document: the present document. If the marks ``BEGIN`` and ``END`` are in it, only the part
            between them is replaced.
    """
    entries: Sequence[Entry] = results["sessions"]
    parts = [
        f"Preset `{results['preset']}`, means over the seeds "
        f"{', '.join(map(str, results['seeds']))}. Nobody was measured: stature, distance and the "
        "camera's pitch are given. The reference is triangulated from several cameras and good to "
        "2 to 3 cm a joint.",
        *_errors(entries),
        *_states(entries),
        *_failures(entries),
        *_sources(entries),
        _made(results),
    ]
    text = "\n\n".join(parts)
    try:
        return replaced(document, text, BEGIN, END)
    except CardboxError:
        return f"# Real people\n\n{BEGIN}\n{text}\n{END}\n"


def _made(results: Results) -> str:
    made = results["provenance"]
    return f"Made by `{results['command']}` at commit {made['commit']} on {made['cpu']}."


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


def _over(group: Sequence[Entry], figure: Callable[[Entry], float]) -> float:
    """Return the mean of a figure over the sessions that have it."""
    known = [value for value in map(figure, group) if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _mean(*path: str, form: str = "{:.1f}") -> Callable[[Sequence[Entry]], str]:
    return lambda group: number(_over(group, lambda one: mean_of(one["runs"], *path)), form)


def _peer(key: str) -> Callable[[Sequence[Entry]], str]:
    return lambda group: number(_over(group, lambda one: one["mediapipe"].get(key, np.nan)))


def _versus(sessions: Sequence[Entry]) -> list[str]:
    """Return the table of errors, compared with MediaPipe's."""
    columns: Columns = {
        "absolute": _mean("absolute"),
        "aligned": _mean("aligned"),
        "MediaPipe aligned": _peer("aligned"),
        "PA": _mean("pa"),
        "MediaPipe PA": _peer("pa"),
        **{f"aligned {kind}s": _mean(f"aligned_{kind}") for kind in ("shoulder", "elbow", "hand")},
    }
    parts = [
        "## Errors, cm",
        "Mean 3D distance of shoulders, elbows and hands. *Aligned*: after both skeletons are "
        "shifted to the middle of their shoulders; *PA*: after the best similarity transform. "
        "MediaPipe Pose (full) gives no metric position, so it has no absolute error.",
        _of_sessions(sessions, columns),
    ]
    errors = {one["name"]: mean_of(one["runs"], "aligned") for one in sessions}
    compared = {
        one["name"]: errors[one["name"]] / one["mediapipe"]["aligned"]
        for one in sessions
        if "aligned" in one["mediapipe"] and np.isfinite(errors[one["name"]])
    }
    if compared:
        worst = max(compared, key=lambda name: compared[name])
        better = sum(ratio < 1 for ratio in compared.values())
        parts.append(
            f"Aligned error below MediaPipe's on {better} of {len(compared)} sessions; the largest "
            f"ratio is {compared[worst]:.2f} ({worst})."
        )
    failures = {
        one["name"]: run["failure"] for one in sessions for run in one["runs"] if run.get("failure")
    }
    told = [f"- `{name}` was not initialized: {text}" for name, text in failures.items()]
    return [*parts, "\n".join(told)] if told else parts


def _steadiness(sessions: Sequence[Entry]) -> list[str]:
    def percent(key: str) -> Callable[[Sequence[Entry]], str]:
        def of(one: Entry) -> float:
            return 100 * mean_of(one["runs"], key) / max(mean_of(one["runs"], "frames"), 1)

        return lambda group: number(_over(group, of))

    def coverage(summary: Callable[[list[float]], Any]) -> Callable[[Sequence[Entry]], str]:
        def of(one: Entry) -> float:
            values = _coverages(one["runs"])
            return 100 * float(summary(values)) if values else float("nan")

        return lambda group: number(_over(group, of))

    columns: Columns = {
        "acceleration error, m/s²": _mean("acceleration"),
        "beside the shoulders": _mean("acceleration_beside"),
        "without estimate, %": percent("without_estimate"),
        "beyond 30 cm, %": percent("far"),
        "images beyond 30 cm that are `tracking`, per run": _mean("far_but_tracking"),
        "coverage: mean, %": coverage(np.mean),
        "least, %": coverage(np.min),
        "most, %": coverage(np.max),
        "ms an image": _mean("ms"),
        "MediaPipe ms": lambda group: number(
            _over(group, lambda one: one["mediapipe_ms"] or np.nan)
        ),
    }
    return [
        "## Steadiness, losses, uncertainty, time",
        "Coverage: share of images in which the true angle of a joint lies within two standard "
        "deviations, over the 11 angles. The acceleration error is that of the joints' positions, "
        "and of those relative to the middle of the shoulders. MediaPipe was timed in another run.",
        _of_sessions(sessions, columns),
    ]


def _coverages(runs: Sequence[Mapping[str, Any]]) -> list[float]:
    """Return the coverage of each angle, as a mean over the runs."""
    names = dict.fromkeys(name for run in runs for name in run.get("coverage", {}))
    return [mean_of(runs, "coverage", name) for name in names]


def _lengths(sessions: Sequence[Entry]) -> list[str]:
    """Return the table of lengths, and the mean and the largest deviation of each."""
    forms = ("{:.3f}", "{:.3f}", "{:.3f}", "{:+.1f}")
    columns: Columns = {
        name: _mean("lengths", key, form=form)
        for (name, key), form in zip(_LENGTHS.items(), forms, strict=True)
    }
    parts = [
        "## Measured lengths, as a ratio to the true ones",
        "The height of the shoulder joints is compared while the arms hang.",
        _of_sessions(sessions, columns),
    ]
    found = np.array(
        [[mean_of(s["runs"], "lengths", key) for key in _LENGTHS.values()] for s in sessions]
    )
    known = found[np.isfinite(found).all(axis=1)]
    if known.size:
        *ratios, height = np.abs(known - (1.0, 1.0, 1.0, 0.0)).T
        texts = [
            f"{name} {100 * off.mean():.1f} % ({100 * off.max():.1f} %)"
            for name, off in zip(_LENGTHS, ratios, strict=False)
        ]
        texts.append(f"shoulder joints {height.mean():.1f} cm ({height.max():.1f} cm)")
        parts.append(f"Mean (largest) deviation: {', '.join(texts)}.")
    return parts


def _recovery(sessions: Sequence[Entry]) -> list[str]:
    """Return the table of recoveries; empty if they were not measured."""
    kinds = dict.fromkeys(
        kind for one in sessions for run in one["runs"] for kind in run.get("recovery", {})
    )
    if not kinds:
        return []

    def cells(group: Sequence[Entry]) -> list[str]:
        found = [run["recovery"] for one in group for run in one["runs"] if "recovery" in run]
        counts = ([sum(one[kind][n] for one in found) for n in _TRIALS] for kind in kinds)
        return [f"{recovered} ({trials})" for recovered, trials in counts]

    rows = [[one["name"], *cells([one])] for one in sessions]
    return [
        "## Recovery after disturbances",
        "Recovered trials, and in brackets all, with the first seed. Recovered: the mean error "
        "from half a second to one second after the disturbance is at most 4 cm above that of the "
        "undisturbed run, or below 10 cm.",
        table(["session", *kinds], [*rows, ["**all**", *cells(sessions)]]),
    ]


_TRIALS = ("recovered", "trials")


def _of_sessions(sessions: Sequence[Entry], columns: Columns) -> str:
    """Return a table of sessions, with means over all and over those with motion capture."""
    groups = {one["name"]: [one] for one in sessions}
    groups[f"**mean of {len(sessions)}**"] = list(sessions)
    captured = [one for one in sessions if MOTION_CAPTURE in one["name"]]
    if 0 < len(captured) < len(sessions):
        groups[f"**motion capture ({len(captured)})**"] = captured
    rows = ([name, *(of(group) for of in columns.values())] for name, group in groups.items())
    return table(["session", *columns], rows)


def _errors(entries: Sequence[Entry]) -> list[str]:
    def spread(group: Sequence[Entry]) -> str:
        """Return the largest minus the smallest of the seeds' means over the sessions."""
        of_seeds = [[run.get("aligned", np.nan) for run in one["runs"]] for one in group]
        means = [float(np.mean(seed)) for seed in zip(*of_seeds, strict=False)]
        return number(float(np.ptp(means)) if len(means) > 1 else np.nan)

    columns: Columns = {
        "absolute": _mean("absolute"),
        "aligned": _mean("aligned"),
        "spread": spread,
        "MediaPipe aligned": _peer("aligned"),
        "PA": _mean("pa"),
        **{f"aligned {kind}s": _mean(f"aligned_{kind}") for kind in ("shoulder", "elbow", "hand")},
        "shoulders' depth": _mean("shoulder_depth", form="{:+.1f}"),
        "hands' depth": _mean("hand_depth", form="{:+.1f}"),
    }
    return [
        "## Errors, cm",
        "Mean 3D distance of shoulders, elbows and hands. *Aligned*: after both skeletons are "
        "shifted to the middle of their shoulders; *spread*: largest minus smallest aligned error "
        "of a seed; *PA*: after the best similarity transform; *depth*: estimate minus reference. "
        "MediaPipe Pose (heavy) has the images of the first camera alone.",
        _of_people(entries, columns),
    ]


def _states(entries: Sequence[Entry]) -> list[str]:
    def share(part: str, whole: str, rest: bool = False) -> Callable[[Sequence[Entry]], str]:
        """Return a percentage over all images of a group, or 100 less that."""

        def text(group: Sequence[Entry]) -> str:
            runs = [run for one in group for run in one["runs"]]
            parts, total = (sum(run.get(key, np.nan) for run in runs) for key in (part, whole))
            percent = 100 * parts / total if total else np.nan
            return number(100 - percent if rest else percent, "{:.0f}")

        return text

    def coverage(group: Sequence[Entry]) -> str:
        values = _coverages([run for one in group for run in one["runs"]])
        return number(100 * float(np.mean(values)) if values else np.nan, "{:.0f}")

    columns: Columns = {
        "images": _mean("frames", form="{:.0f}"),
        "with estimate, %": share("without_estimate", "frames", rest=True),
        "`tracking`, %": share("tracking", "frames"),
        **{
            f"of these beyond {limit_cm} cm, %": share(f"tracking_beyond_{limit_cm}", "tracking")
            for limit_cm in BEYOND_CM
        },
        "coverage, %": coverage,
        "ms": _mean("ms"),
        "input ms": _mean("input_ms"),
    }
    return [
        "## States, uncertainty, time",
        "Beyond: a joint is more than 20 or 30 cm off (not aligned). Coverage: share of the images "
        "in which an angle lies within two standard deviations of the reference, over the 11 "
        "angles. *ms* is the processor time from silhouettes to posture, *input ms* that of "
        "decoding, silhouettes and points.",
        _of_people(entries, columns),
    ]


def _failures(entries: Sequence[Entry]) -> list[str]:
    failures = dict.fromkeys(
        f"- `{one['name']}` ({', '.join(_inputs(one))}) has no figures: {run['failure']}"
        for one in entries
        for run in one["runs"]
        if run.get("failure")
    )
    return ["\n".join(failures)] if failures else []


def _sources(entries: Sequence[Entry]) -> list[str]:
    sources: dict[str, dict[str, None]] = {}
    for one in entries:
        sources.setdefault(one["source"], {})[f"`{one['name']}`"] = None
    lines = [f"- {', '.join(names)}: {source}" for source, names in sources.items() if source]
    return ["Sources and licences of the recordings:", "\n".join(lines)] if lines else []


def _of_people(entries: Sequence[Entry], columns: Columns) -> str:
    """Return a table with a row for each entry, and one for each group with the same inputs."""
    groups: dict[tuple[str, ...], list[Entry]] = {}
    for one in entries:
        groups.setdefault((one["group"], *_inputs(one)), []).append(one)
    named = [(one["name"], [one]) for one in entries]
    named += [
        (f"**mean of {len(group)} in {name}**", group)
        for (name, *_), group in groups.items()
        if len(group) > 1
    ]
    rows = ([name, *_inputs(g[0]), *(of(g) for of in columns.values())] for name, g in named)
    return table(["session", "cameras", "silhouettes", "points", *columns], rows)


def _inputs(one: Entry) -> tuple[str, ...]:
    return " ".join(one["cameras"]) or "one", one["silhouettes"], one["points"]
