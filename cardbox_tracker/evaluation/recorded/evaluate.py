"""``cardbox evaluate --sessions``: figures and report of recorded sessions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.precompile import compile_all
from cardbox_tracker.evaluation.recorded.figures import figures
from cardbox_tracker.evaluation.recorded.report import sessions_report
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.evaluation.recorded.tracking import (
    WITH_DEPTH,
    InputSelection,
    recovery_of,
    track_session,
)
from cardbox_tracker.evaluation.results import provenance, write_json
from cardbox_tracker.files import atomic_path


def evaluate_sessions(
    folders: Sequence[Path],
    output: Path,
    preset: str,
    seeds: tuple[int, ...],
    jobs: int,
    recovery: bool = False,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Evaluate recorded sessions; write ``sessions.json`` and ``sessions.md`` into ``output``.

    Args:
        folders: sessions, each with ``bag/`` and ``ground_truth.json``.
        output: folder of the results; made if it is missing.
        preset: a name of ``PRESETS``.
        seeds: random seeds of initialization and filters, one run for each.
        jobs: number of processes.
        recovery: also count the recoveries from disturbances.
        progress: called with the finished fraction.

    Returns:
        The contents of ``sessions.json``.

    Raises:
        CardboxError: a folder is not a session, or the results cannot be written.
    """
    for folder in folders:
        load_session(folder)  # report errors before the work begins
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CardboxError(f"cannot make the folder {output}: {error.strerror}") from None
    compile_all()
    sessions = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        work = [
            pool.submit(evaluate_session, folder, preset, seeds, recovery, only)
            for folder in folders
            for only in _each_way(folder)
        ]
        for done, future in enumerate(work, 1):
            sessions.append(future.result())
            if progress is not None:
                progress(done / len(work))
    names = " ".join(folder.name for folder in folders)
    results = {
        "command": f"cardbox evaluate --sessions {names} --output DIR",
        "preset": preset,
        "seeds": list(seeds),
        "sessions": sessions,
        "provenance": provenance(),
    }
    write_json(results, output / "sessions.json")
    with atomic_path(output / "sessions.md") as temporary:
        temporary.write_text(sessions_report(results), encoding="utf-8")
    return results


def _named(only: str | None) -> str:
    if only is None:
        return ""
    return ", with depth" if only == WITH_DEPTH else f", {only} alone"


def _each_way(folder: Path) -> list[str | None]:
    """Return the cameras that track in each run: None for all, a name, or ``WITH_DEPTH``."""
    truth = load_session(folder).truth
    alone = truth.cameras if len(truth.cameras) > 1 else ()
    has_depth = truth.is_rectified or truth.depth_topic is not None
    return [None, *alone, *([WITH_DEPTH] if has_depth else [])]


def evaluate_session(
    folder: Path,
    preset: str,
    seeds: tuple[int, ...],
    recovery: bool = False,
    only: str | None = None,
) -> dict[str, Any]:
    """Return the figures of one session: those of each run, and MediaPipe's.

    All cameras of the session track. If ``only`` names one camera, it tracks alone, and MediaPipe's
    figures are omitted. With ``recovery``, the first seed's run also counts the recoveries from
    disturbances.
    """
    session = load_session(folder)
    config = PRESETS[preset]()
    try:
        runs = track_session(session, config, seeds, InputSelection(only))
        found = [figures(session, run) for run in runs]
        if runs[0].body is not None and recovery and only is None:
            found[0]["recovery"] = {
                kind: asdict(one)
                for kind, one in recovery_of(session, runs[0].body, config, seeds[0]).items()
            }
    except CardboxError as error:
        found = [{"frames": len(session.stamps_ns), "failure": str(error)}]
    return {
        "name": session.name + _named(only),
        "mediapipe": session.mediapipe if only is None else {},
        "mediapipe_ms": session.mediapipe_ms,
        "runs": found,
    }
