"""Evidence for or against the result of a search, from the rated states of one frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.filtering import loss


def evidence_in(
    cost: MultiViewCost,
    rated: tuple[FloatArray, FloatArray],
    result: tuple[FloatArray, FloatArray],
    drawn_px: tuple[float, float],
    spreads_m: Sequence[float],
    age: int,
) -> loss.Evidence:
    """Return the evidence for the mean of the best states.

    Args:
        cost: cost with the silhouettes of the frame.
        rated: states (N, 14) and their ratings (N,).
        result: mean and deviations of the best states, (14,) each.
        drawn_px: pixels in which the mean state and the silhouettes differ, and of the mean state.
        spreads_m: deviations of elbows and hands in the search of the arms, m.
        age: frames since the search began.
    """
    _, ratings = rated
    mean, stddev = result
    differing_px, area_px = drawn_px
    pixels = loss.Pixels(cost.silhouette_px, cost.frontal_px_at(mean), differing_px, area_px)
    best = int(np.argmin(ratings))
    rating = float(ratings[best])
    arm_m = sum(spreads_m) / len(spreads_m)
    return loss.evidence_of(pixels, rating, arm_m, stddev, mean, age)
