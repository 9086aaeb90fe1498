"""RULA of a recording's images: the neck counts where its angles are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from cardbox_tracker.body.proportions import body_from_proportions
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.estimation.estimate import NO_PERSON, TRACKING, Estimate
from cardbox_tracker.recordings.rula import RulaObserver


class Still:
    """A tracker that is sure that the person stands upright, with hanging arms."""

    body = body_from_proportions(1.75, 2.0)
    stamp_ns = 0

    def sample(self, estimate: Estimate, count: int, rng: np.random.Generator) -> np.ndarray:
        """Every sample is the posture itself."""
        return np.tile(cast(Any, estimate.posture), (count, 1))


def likeliest(*estimates: Estimate) -> list[int | None]:
    observer = RulaObserver(RulaConfig(), seed=0)
    for estimate in estimates:
        observer(cast(Any, Still()), estimate, cast(Any, Still()))
    return [None if row.scores is None else row.scores.likeliest for row in observer.rows]


def test_a_bent_neck_raises_the_score() -> None:
    """On the worksheet, A 2 with necks 1 and 3 give 2 and 3."""
    plain = Estimate(TRACKING, np.zeros(12), np.zeros(12))
    bent = replace(plain, neck=np.array([0.0, 0.5]), neck_stddev=np.full(2, 0.01))
    assert likeliest(plain, bent, Estimate(NO_PERSON)) == [2, 3, None]
