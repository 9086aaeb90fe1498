"""How ``effort`` trades time for accuracy: ``python -m lab.tools.effort_table SESSION...``.

The tool tracks recorded sessions with ground truth with several efforts of the preset ``default``.
It prints a Markdown table with a row for each effort: the median time of an image from silhouette
to posture, ms, the same divided by that of effort 1, and for each session the mean error of the
keypoints, cm. With ``--plot`` it also draws errors and times against the effort.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.search.config import PRESETS
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import SessionRun, track_session
from lab.pages import plot, table

EFFORTS = (0.25, 0.5, 1.0, 2.0, 4.0)


class Measured(NamedTuple):
    """The figures of one effort.

    Attributes:
        effort: the setting.
        milliseconds: median time of an image from silhouette to posture, ms.
        errors_cm: mean error of the keypoints by the name of the session, cm.
    """

    effort: float
    milliseconds: float
    errors_cm: dict[str, float]


def runs_of(session: RecordedSession, effort: float, seeds: Sequence[int]) -> list[SessionRun]:
    """Track a session with an effort, once for each seed."""
    preset = PRESETS["default"]()
    config = replace(preset, whole_body=replace(preset.whole_body, effort=effort))
    return track_session(session, config, tuple(seeds))


def error_cm(session: RecordedSession, runs: Sequence[SessionRun]) -> float:
    """Return the mean distance of found from true keypoints, cm."""
    off_m = np.array([run.keypoints_m - session.keypoints_m for run in runs])
    return 100.0 * float(np.nanmean(np.linalg.norm(off_m, axis=-1)))


def measured(folders: Sequence[Path], seeds: Sequence[int]) -> list[Measured]:
    """Return the figures of each of ``EFFORTS``."""
    times_ms: dict[float, list[float]] = {effort: [] for effort in EFFORTS}
    errors_cm: dict[float, dict[str, float]] = {effort: {} for effort in EFFORTS}
    for session in map(load_session, folders):
        # The efforts alternate, so that other work of the machine slows all of them.
        for effort in EFFORTS:
            runs = runs_of(session, effort, seeds)
            times_ms[effort] += [ms for run in runs for ms in run.milliseconds]
            errors_cm[effort][session.name] = error_cm(session, runs)
    return [
        Measured(effort, float(np.median(times_ms[effort])), errors_cm[effort])
        for effort in EFFORTS
    ]


def ratios(rows: Sequence[Measured]) -> list[float]:
    """Return the times divided by the time of effort 1."""
    (of_one,) = (row.milliseconds for row in rows if row.effort == 1.0)
    return [row.milliseconds / of_one for row in rows]


def effort_table(rows: Sequence[Measured]) -> str:
    """Return the table."""
    names = [f"{name}, cm" for name in rows[0].errors_cm]
    return table(
        ["effort", "ms an image", "times effort 1", *names],
        (
            [f"{row.effort:g}", f"{row.milliseconds:.1f}", f"{ratio:.2f}"]
            + [f"{error:.1f}" for error in row.errors_cm.values()]
            for row, ratio in zip(rows, ratios(rows), strict=True)
        ),
    )


def draw(rows: Sequence[Measured], path: Path) -> None:
    """Write a PNG with the errors, and the times relative to effort 1, against the effort.

    Raises:
        CardboxError: the file cannot be written.
    """
    efforts = [row.effort for row in rows]
    with plot(path, (1, 2), (9, 3.6), dpi=90) as axes:
        errors, times = axes[0]
        for name in rows[0].errors_cm:
            errors.plot(efforts, [row.errors_cm[name] for row in rows], "o-", label=name)
        errors.set(ylabel="mean error of the keypoints [cm]")
        errors.legend()
        times.plot(efforts, ratios(rows), "o-", color="black")
        times.set(ylabel="time of an image / time at effort 1")
        for axis in (errors, times):
            axis.set_xscale("log", base=2)
            axis.set_xticks(efforts, [f"{effort:g}" for effort in efforts])
            axis.set(xlabel="effort")
            axis.set_ylim(bottom=0.0)
            axis.grid(color="0.9")


def main(args: Sequence[str] | None = None) -> None:
    """Track, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=2, help="runs of each session")
    parser.add_argument("--plot", type=Path, default=None, metavar="OUT.png")
    given = parser.parse_args(args)
    rows = measured(given.sessions, range(given.seeds))
    print(effort_table(rows))
    if given.plot is not None:
        draw(rows, given.plot)


if __name__ == "__main__":
    main()
