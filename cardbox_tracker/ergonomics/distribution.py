"""The score of an uncertain posture: how likely each value is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.rula import rula_scores
from cardbox_tracker.ergonomics.tables import HIGHEST, ScoreArray

SAMPLES = 500
"""Postures of a distribution: a chance of a half is then known to 0.02."""

_SCORES = np.arange(1, HIGHEST + 1)


class ScoreDistribution(NamedTuple):
    """Chances (7,) of the grand scores 1 to 7, each adding up to 1.

    Attributes:
        grand: of the worse arm.
        left: of the left arm.
        right: of the right arm.
    """

    grand: FloatArray
    left: FloatArray
    right: FloatArray

    @property
    def mean(self) -> float:
        """Expected grand score."""
        return expected(self.grand)

    @property
    def likeliest(self) -> int:
        """Grand score with the largest chance; of equal ones the lowest."""
        return int(np.argmax(self.grand)) + 1

    def chance_above(self, score: int) -> float:
        """Return the chance that the grand score is higher than ``score``."""
        return float(self.grand[score:].sum())


def expected(chances: FloatArray) -> float:
    """Return the expected score of chances (7,)."""
    return float(chances @ _SCORES)


def score_distribution(
    body: BodyModel, postures: FloatArray, config: RulaConfig
) -> ScoreDistribution:
    """Return how likely each score is, given equally likely postures (n, 12) of ``body``."""
    scores = rula_scores(body, postures, config)
    return ScoreDistribution(*map(_chances, (scores.grand, scores.left.grand, scores.right.grand)))


def _chances(scores: ScoreArray) -> FloatArray:
    found: FloatArray = np.bincount(scores, minlength=HIGHEST + 1)[1:] / len(scores)
    return found
