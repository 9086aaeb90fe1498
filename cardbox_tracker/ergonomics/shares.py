"""Time spent at each score of each part, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import expected
from cardbox_tracker.ergonomics.parts import DECLARED, DECLARED_PARTS, MEASURED, MIXED, NECK, PARTS
from cardbox_tracker.ergonomics.recording import RulaRow, scored_times
from cardbox_tracker.ergonomics.tables import HIGHEST
from cardbox_tracker.files import write_table

SHARES_HEADER = ("part", "source", "score", "time_s", "share")


@dataclass(frozen=True)
class ScoreShares:
    """Expected time at each score of a part.

    Attributes:
        name: of the part, as in the tables.
        words: the same for people.
        source: ``MEASURED``, ``DECLARED`` or ``MIXED``.
        time_s: time (n,) at the scores 1 to n, s.
    """

    name: str
    words: str
    source: str
    time_s: FloatArray

    @property
    def shares(self) -> FloatArray:
        """Shares (n,) of the measured time; nan without any."""
        total_s = float(self.time_s.sum())
        nothing = np.full(len(self.time_s), np.nan)
        return self.time_s / total_s if total_s else nothing

    @property
    def mean(self) -> float:
        """Expected score; nan without any measured time."""
        return expected(self.shares)


def score_shares(rows: Sequence[RulaRow], config: RulaConfig) -> tuple[ScoreShares, ...]:
    """Return the time at each score: the grand score, measured parts and tables, declared parts."""
    durations_s, scored = scored_times(rows)

    def times(chances: list[FloatArray], highest: int) -> FloatArray:
        found: FloatArray = durations_s @ np.reshape(chances, (-1, highest))
        return found

    every = [scores for _, scores in scored]
    grand = times([scores.grand for scores in every], HIGHEST)
    shares = [ScoreShares("grand", "grand score", MIXED, grand)]
    necks = {row.is_neck_measured for row, _ in scored} or {False}
    for part in PARTS:
        source = MEASURED
        if part.name == NECK:
            source = MIXED if len(necks) > 1 else (DECLARED, MEASURED)[necks.pop()]
        elif "table" in part.name:
            source = MIXED
        time_s = times([scores.parts[part.name] for scores in every], part.highest)
        shares.append(ScoreShares(part.name, part.words, source, time_s))
    for name, highest in DECLARED_PARTS.items():
        time_s = np.eye(highest)[getattr(config, name) - 1] * durations_s.sum()
        shares.append(ScoreShares(name, name.replace("_", " "), DECLARED, time_s))
    return tuple(shares)


def write_shares(shares: Sequence[ScoreShares], path: Path) -> None:
    """Write ``SHARES_HEADER`` and a row for each score of each part; unknown shares are empty.

    Raises:
        CardboxError: the file cannot be written.
    """
    write_table(
        path,
        SHARES_HEADER,
        (
            (one.name, one.source, str(score), f"{time_s:.3f}", "" if np.isnan(x) else f"{x:.4f}")
            for one in shares
            for score, (time_s, x) in enumerate(zip(one.time_s, one.shares, strict=True), 1)
        ),
    )
