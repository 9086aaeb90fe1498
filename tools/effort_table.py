"""How ``effort`` trades time for accuracy: ``python -m tools.effort_table SESSION...``.

The tool tracks recorded sessions with ground truth with several efforts of the preset ``default``.
It prints a Markdown table with a row for each effort: the median time of an image from silhouette
to posture, ms, and for each session the mean error of the keypoints, cm.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.evaluation.recorded.session import RecordedSession, load_session
from cardbox_tracker.evaluation.recorded.tracking import SessionRun, track_session

EFFORTS = (0.25, 0.5, 1.0, 2.0, 4.0)


def runs_of(session: RecordedSession, effort: float, seeds: Sequence[int]) -> list[SessionRun]:
    """Track a session with an effort, once for each seed."""
    preset = PRESETS["default"]()
    config = replace(preset, whole_body=replace(preset.whole_body, effort=effort))
    return track_session(session, config, tuple(seeds))


def error_cm(session: RecordedSession, runs: Sequence[SessionRun]) -> float:
    """Return the mean distance of found from true keypoints, cm."""
    off_m = np.array([run.keypoints_m - session.keypoints_m for run in runs])
    return 100.0 * float(np.nanmean(np.linalg.norm(off_m, axis=-1)))


def table(folders: Sequence[Path], seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table; the efforts are compared one after the other."""
    sessions = [load_session(folder) for folder in folders]
    columns = ["effort", "ms an image", *(f"{session.name}, cm" for session in sessions)]
    lines = [_row(columns), "|---" * len(columns) + "|"]
    for effort in EFFORTS:
        found = [runs_of(session, effort, seeds) for session in sessions]
        times_ms = [run.milliseconds for runs in found for run in runs]
        errors = [f"{error_cm(*pair):.1f}" for pair in zip(sessions, found, strict=True)]
        lines.append(_row([f"{effort:g}", f"{np.median(np.concatenate(times_ms)):.1f}", *errors]))
    return lines


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main(args: Sequence[str] | None = None) -> None:
    """Track and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=2, help="runs of each session")
    given = parser.parse_args(args)
    print(*table(given.sessions, range(given.seeds)), sep="\n")


if __name__ == "__main__":
    main()
