"""The three look-up tables of RULA, as published.

L. McAtamney and E. N. Corlett, "RULA: a survey method for the investigation of work-related upper
limb disorders", Applied Ergonomics 24(2), 1993, pages 91-99. All scores count from 1, so an index
is the score less one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ScoreArray = NDArray[np.int64]


def _table(rows: str, *shape: int) -> ScoreArray:
    table = np.array(rows.split(), dtype=np.int64).reshape(shape)
    table.setflags(write=False)
    return table


TABLE_A: ScoreArray = _table(
    """
    1 2  2 2  2 3  3 3    2 2  2 2  3 3  3 3    2 3  3 3  3 3  4 4
    2 3  3 3  3 4  4 4    3 3  3 3  3 4  4 4    3 4  4 4  4 4  5 5
    3 3  4 4  4 4  5 5    3 4  4 4  4 4  5 5    4 4  4 4  4 5  5 5
    4 4  4 4  4 5  5 5    4 4  4 4  4 5  5 5    4 4  4 5  5 5  6 6
    5 5  5 5  5 6  6 7    5 6  6 6  6 7  7 7    6 6  6 7  7 7  7 8
    7 7  7 7  7 8  8 9    8 8  8 8  8 9  9 9    9 9  9 9  9 9  9 9
    """,
    *(6, 3, 4, 2),
)
"""Posture of one arm: upper arm (6), lower arm (3), wrist (4), wrist twist (2)."""

TABLE_B: ScoreArray = _table(
    """
    1 3  2 3  3 4  5 5  6 6  7 7
    2 3  2 3  4 5  5 5  6 7  7 7
    3 3  3 4  4 5  5 6  6 7  7 7
    5 5  5 6  6 7  7 7  7 7  8 8
    7 7  7 7  7 8  8 8  8 8  8 8
    8 8  8 8  8 8  8 9  9 9  9 9
    """,
    *(6, 6, 2),
)
"""Posture of the rest: neck (6), trunk (6), legs (2)."""

TABLE_C: ScoreArray = _table(
    """
    1 2 3 3 4 5 5
    2 2 3 4 4 5 5
    3 3 3 4 4 5 6
    3 3 3 4 5 6 6
    4 4 4 5 6 7 7
    4 4 5 6 6 7 7
    5 5 6 6 7 7 7
    5 5 6 7 7 7 7
    """,
    *(8, 7),
)
"""Grand score: wrist and arm (8 or more), neck, trunk and legs (7 or more)."""

HIGHEST = 7
"""Highest grand score."""

ACTION_LEVELS: tuple[tuple[int, int, str], ...] = (
    (1, 2, "acceptable unless it is held or repeated for long"),
    (3, 4, "investigate further; changes may be required"),
    (5, 6, "investigate and change soon"),
    (7, 7, "investigate and change immediately"),
)
"""Lowest and highest grand score of each action level, and its meaning in the paper."""
