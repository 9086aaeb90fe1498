"""RULA of a recording: a row per image and the time spent at each score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.ergonomics.distribution import ScoreDistribution, expected
from cardbox_tracker.ergonomics.parts import DECLARED, MEASURED, PARTS
from cardbox_tracker.ergonomics.tables import ACTION_LEVELS, HIGHEST
from cardbox_tracker.estimation.estimate import UNCERTAIN
from cardbox_tracker.files import write_table

ABOVE = 5
"""Score above which time is counted, since work has to be changed soon or at once."""

CSV_HEADER = (
    *("stamp_ns", "state", "score", "likeliest", f"chance_above_{ABOVE}"),
    *(f"chance_{score}" for score in range(1, HIGHEST + 1)),
    *("left_score", "right_score"),
    *(part.name for part in PARTS),
    "neck_from",
)

LONGEST_STEP = 3.0
"""An image counts until the next one, for at most this multiple of the usual interval."""


@dataclass(frozen=True)
class RulaRow:
    """One image.

    Attributes:
        stamp_ns: stamp of the image.
        state: of the tracker.
        scores: its scores; None without a posture.
        time_s: seconds from the recording's start.
        is_neck_measured: whether the neck's score is measured; otherwise it is declared.
    """

    stamp_ns: int
    state: str
    scores: ScoreDistribution | None
    time_s: float
    is_neck_measured: bool = False


@dataclass(frozen=True)
class RulaSummary:
    """Expected times, s.

    Attributes:
        measured_s: time with a posture.
        above_s: time with a score above ``ABOVE``.
        by_level_s: time at each of ``ACTION_LEVELS``.
        mean: expected score over the measured time; nan without any.
        uncertain_s: part of the measured time whose postures may be wrong.
        neck_measured_s: part of the measured time with a measured neck.
    """

    measured_s: float
    above_s: float
    by_level_s: tuple[float, ...]
    mean: float
    uncertain_s: float
    neck_measured_s: float

    @property
    def is_neck_always_measured(self) -> bool:
        """Whether no image with a posture has a declared neck."""
        return 0 < self.measured_s <= self.neck_measured_s + 1e-9


def summarize(rows: Sequence[RulaRow]) -> RulaSummary:
    """Return the expected time spent at each score."""
    durations_s, scored = scored_times(rows)
    chances = np.array([scores.grand for _, scores in scored])
    time_s = durations_s @ chances if len(chances) else np.zeros(HIGHEST)
    total_s = float(durations_s.sum())
    return RulaSummary(
        total_s,
        float(time_s[ABOVE:].sum()),
        tuple(float(time_s[low - 1 : high].sum()) for low, high, _ in ACTION_LEVELS),
        expected(time_s / total_s) if total_s else float("nan"),
        float(durations_s @ np.array([row.state == UNCERTAIN for row, _ in scored], float)),
        float(durations_s @ np.array([row.is_neck_measured for row, _ in scored], float)),
    )


def scored_times(
    rows: Sequence[RulaRow],
) -> tuple[FloatArray, list[tuple[RulaRow, ScoreDistribution]]]:
    """Return the images with a posture, and the time (n,) that each of them stands for, s."""
    durations_s = _durations_s(np.array([row.stamp_ns for row in rows], np.int64))
    is_scored = np.array([row.scores is not None for row in rows], dtype=bool)
    scored = [(row, row.scores) for row in rows if row.scores is not None]
    return durations_s[is_scored], scored


def _durations_s(stamps_ns: np.typing.NDArray[np.int64]) -> FloatArray:
    if len(stamps_ns) < 2:
        return np.zeros(len(stamps_ns))
    steps_s = np.diff(stamps_ns) / 1e9
    usual_s = float(np.median(steps_s))
    durations: FloatArray = np.append(np.clip(steps_s, 0.0, LONGEST_STEP * usual_s), usual_s)
    return durations


def write_csv(rows: Sequence[RulaRow], path: Path) -> None:
    """Write ``CSV_HEADER`` and a row per image; unknown values are left empty.

    Raises:
        CardboxError: the file cannot be written.
    """
    write_table(path, CSV_HEADER, map(_fields, rows))


def _fields(row: RulaRow) -> list[str]:
    stamp = str(row.stamp_ns)
    if row.scores is None:
        return [stamp, row.state, *[""] * (len(CSV_HEADER) - 2)]
    scores = row.scores
    return [
        stamp,
        row.state,
        f"{scores.mean:.3f}",
        str(scores.likeliest),
        f"{scores.chance_above(ABOVE):.3f}",
        *(f"{chance:.3f}" for chance in scores.grand),
        f"{expected(scores.left):.3f}",
        f"{expected(scores.right):.3f}",
        *(f"{expected(scores.parts[part.name]):.3f}" for part in PARTS),
        MEASURED if row.is_neck_measured else DECLARED,
    ]
