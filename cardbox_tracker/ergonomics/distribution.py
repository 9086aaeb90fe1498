"""Probability distribution of the score of an uncertain posture."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import NECK_LIMITS
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.parts import PARTS
from cardbox_tracker.ergonomics.rula import rula_scores
from cardbox_tracker.ergonomics.tables import HIGHEST, ScoreArray

SAMPLES = 500
"""Samples of a distribution; the standard error of a probability of 0.5 is then 0.02."""


class ScoreDistribution(NamedTuple):
    """Probabilities (7,) of the grand scores 1 to 7; each array adds up to 1.

    Attributes:
        grand: probabilities for the worse arm.
        left: probabilities for the left arm.
        right: probabilities for the right arm.
        parts: probabilities of the scores from 1 on of each of ``PARTS``, by its name; empty if
            they are not known.
    """

    grand: FloatArray
    left: FloatArray
    right: FloatArray
    parts: Mapping[str, FloatArray] = MappingProxyType({})

    @property
    def mean(self) -> float:
        """Expected grand score."""
        return expected(self.grand)

    @property
    def likeliest(self) -> int:
        """Most probable grand score; the lowest of equally probable ones."""
        return int(np.argmax(self.grand)) + 1

    def chance_above(self, score: int) -> float:
        """Return the probability that the grand score is higher than ``score``."""
        return float(self.grand[score:].sum())


def expected(chances: FloatArray) -> float:
    """Return the expected score of the probabilities (n,) of the scores 1 to n."""
    return float(chances @ np.arange(1, len(chances) + 1))


def neck_samples(
    neck: FloatArray, stddev: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return normal samples (count, 2) of ``neck_yaw`` and ``neck_pitch``, rad, in their limits."""
    drawn = neck + stddev * rng.standard_normal((count, len(neck)))
    samples: FloatArray = np.clip(drawn, NECK_LIMITS[:, 0], NECK_LIMITS[:, 1])
    return samples


def score_distribution(
    body: BodyModel, postures: FloatArray, config: RulaConfig, necks: FloatArray | None = None
) -> ScoreDistribution:
    """Return the distribution of the scores, given equally likely postures (n, 12) of ``body``.

    ``necks`` (n, 2) are the angles of the neck in each of them, rad; None if they are unknown.
    """
    scores = rula_scores(body, postures, config, necks)
    grand, left, right = (
        _chances(one, HIGHEST) for one in (scores.grand, scores.left.grand, scores.right.grand)
    )
    parts = {part.name: _chances(part.of(scores), part.highest) for part in PARTS}
    return ScoreDistribution(grand, left, right, parts)


def _chances(scores: ScoreArray, highest: int) -> FloatArray:
    found: FloatArray = np.bincount(scores, minlength=highest + 1)[1:] / len(scores)
    return found
