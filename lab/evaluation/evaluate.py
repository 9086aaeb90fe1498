"""``cardbox evaluate --sessions``: figures and report of recorded sessions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import make_folder, write_file
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.precompile import compile_all
from lab.evaluation.figures import figures
from lab.evaluation.people import people_figures
from lab.evaluation.plan import NO_POINTS, Plan, Way, ways_of
from lab.evaluation.report import people_report, sessions_report
from lab.evaluation.results import provenance, write_json
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import (
    BACKGROUND,
    DETECTOR,
    WITH_DEPTH,
    InputSelection,
    recovery_of,
    track_session,
)

SESSIONS, PEOPLE = "sessions", "real-people"
"""Names of the results of sessions with reference postures, and of sessions of real people."""


def result_name(folder: Path) -> str:
    """Return ``SESSIONS`` or ``PEOPLE``, the name of the results with this session.

    Raises:
        CardboxError: the folder is not a session.
    """
    return SESSIONS if load_session(folder).has_references else PEOPLE


def evaluate_sessions(
    folders: Sequence[Path],
    output: Path,
    plan: Plan,
    jobs: int,
    progress: Callable[[float], None] | None = None,
) -> dict[str, dict[str, Any]]:
    """Evaluate recorded sessions and write their results into ``output``.

    Sessions with reference postures are in ``sessions.json`` and ``sessions.md``, sessions of real
    people in ``real-people.json`` and ``real-people.md``.

    Args:
        folders: sessions, each with ``bag/`` and ``ground_truth.json``.
        output: folder of the results; made if it is missing.
        plan: settings.
        jobs: number of processes; 1 stays in this one.
        progress: called with the finished fraction.

    Returns:
        The contents of the JSON files, by ``SESSIONS`` and ``PEOPLE``.

    Raises:
        CardboxError: a folder is not a session, or the results cannot be written.
    """
    # Errors are reported before the work begins.
    ways = {folder: ways_of(folder, plan) for folder in folders}
    kinds = {folder: result_name(folder) for folder in folders}
    make_folder(output)
    compile_all()
    # The code may change while it runs.
    made = provenance()
    sessions: dict[str, list[dict[str, Any]]] = {kind: [] for kind in kinds.values()}
    work = [(kinds[folder], way) for folder in folders for way in ways[folder]]
    parallel = Parallel(jobs, return_as="generator", batch_size=1)
    found = parallel(delayed(evaluate_session)(way, plan) for _, way in work)
    for done, ((kind, _), one) in enumerate(zip(work, found, strict=True), 1):
        sessions[kind].append(one)
        if progress is not None:
            progress(done / len(work))
    results = {}
    for kind, found in sessions.items():
        names = " ".join(folder.name for folder in folders if kinds[folder] == kind)
        results[kind] = {
            "command": f"cardbox evaluate --sessions {names}{plan.words} --output DIR",
            "preset": plan.preset,
            "seeds": list(plan.seeds),
            "sessions": found,
            "provenance": made,
        }
        _write(results[kind], output / f"{kind}.md")
    return results


def _write(results: Mapping[str, Any], path: Path) -> None:
    write_json(results, path.with_suffix(".json"))
    if path.stem == SESSIONS:
        text = sessions_report(results)
    else:
        text = people_report(results, path.read_text("utf-8") if path.is_file() else "")
    write_file(path, text)


def evaluate_session(way: Way, plan: Plan) -> dict[str, Any]:
    """Return the figures of one session, tracked in one way: those of each run, and MediaPipe's.

    If one camera of a session with references tracks alone, MediaPipe's figures are omitted. With
    ``plan.recovery``, the first seed's run also counts the recoveries from disturbances.
    """
    session = load_session(way.folder, way.cameras)
    entry = _measured(session, way) if session.has_references else _unmeasured(session, way)
    return entry | {"mediapipe_ms": session.mediapipe_ms, "runs": _runs(session, way, plan)}


def _runs(session: RecordedSession, way: Way, plan: Plan) -> list[dict[str, Any]]:
    config = PRESETS[plan.preset]()
    inputs = InputSelection(way.only, silhouettes=way.silhouettes, points=plan.points[way.points])
    try:
        runs = track_session(session, config, plan.seeds, inputs)
        if not session.has_references:
            return [people_figures(session, run) for run in runs]
        found = [figures(session, run) for run in runs]
        if runs[0].body is not None and plan.recovery and way.only is None:
            found[0]["recovery"] = {
                kind: asdict(one)
                for kind, one in recovery_of(session, runs[0].body, config, plan.seeds[0]).items()
            }
    except CardboxError as error:
        found = [{"frames": len(session.stamps_ns), "failure": str(error)}]
    return found


def _measured(session: RecordedSession, way: Way) -> dict[str, Any]:
    name = session.name
    if way.only is not None:
        name += ", with depth" if way.only == WITH_DEPTH else f", {way.only} alone"
    if way.silhouettes is not None:
        name += f", silhouettes of {way.silhouettes}"
    if way.points != NO_POINTS:
        name += f", points of {way.points}"
    return {"name": name, "mediapipe": session.mediapipe if way.only is None else {}}


def _unmeasured(session: RecordedSession, way: Way) -> dict[str, Any]:
    has_empty = "empty" in session.spans
    return {
        "name": session.name,
        "group": way.folder.resolve().parent.name,
        "source": session.truth.source,
        "cameras": list(session.truth.cameras),
        "silhouettes": way.silhouettes or (BACKGROUND if has_empty else DETECTOR),
        "points": way.points,
        "mediapipe": session.mediapipe,
    }
