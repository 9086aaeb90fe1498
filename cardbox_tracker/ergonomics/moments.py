"""The worst moments of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cardbox_tracker.ergonomics.recording import RulaRow
from cardbox_tracker.estimation.estimate import UNCERTAIN

MOST_MOMENTS = 6
GAP_S = 3.0
"""Least time between two of the moments, s."""


class WorstMoments(NamedTuple):
    """The worst moments.

    Attributes:
        rows: images with the highest expected scores, the worst first.
        uncertain: number of images that were left out because their posture may be wrong.
    """

    rows: tuple[RulaRow, ...]
    uncertain: int


def worst_moments(
    rows: Sequence[RulaRow], most: int = MOST_MOMENTS, gap_s: float = GAP_S
) -> WorstMoments:
    """Return up to ``most`` images with the highest expected scores, ``gap_s`` or more apart.

    The earlier one of equal scores comes first. Images without a posture do not count.
    """
    found: list[RulaRow] = []
    for row in sorted(rows, key=_rank):
        if len(found) == most or not is_candidate(row):
            break
        if all(abs(row.stamp_ns - other.stamp_ns) >= gap_s * 1e9 for other in found):
            found.append(row)
    uncertain = sum(row.scores is not None and row.state == UNCERTAIN for row in rows)
    return WorstMoments(tuple(found), uncertain)


def is_candidate(row: RulaRow) -> bool:
    """Return whether an image can be one of the worst moments."""
    return row.scores is not None and row.state != UNCERTAIN


def _rank(row: RulaRow) -> tuple[float, int]:
    score = row.scores.mean if row.scores is not None and is_candidate(row) else 0.0
    return -score, row.stamp_ns
