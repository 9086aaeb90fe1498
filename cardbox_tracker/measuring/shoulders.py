"""Rise and depth of the shoulder joints.

A person's shoulders can be some centimetres before or behind the hips. The outline of ``side``
shows it: the middle of the chest against the middle of the hips.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.outline import plane_points_m, row_heights_m
from cardbox_tracker.measuring.references import Silhouette
from cardbox_tracker.person.sizes import FloatArray

GIRDLE_RISE = 0.068
"""Lift of the shoulder joints from ``front`` to ``arms`` in shoulder breadths.

The clavicle has a length of about 0.43 breadths and rises by about 9 degrees until the arm is at 80
degrees (Inman, Saunders & Abbott, "Observations on the Function of the Shoulder Joint", 1944).
"""

# Distance from the mean, in standard deviations, at which a reading has half of its weight.
_OUTLIER_SD = 1.5
_AVERAGING_STEPS = 10
# Rows of chest and hips below the shoulder joints, in spans.
_CHEST, _HIPS = (0.01, 0.06), (0.25, 0.30)
# Share of the seen depth that is true on average: outlines of clothes, hair and faults scatter as
# much as people do.
_TRUST = 0.5
# Largest seen depth of the shoulders before or behind the hips.
_FARTHEST_M = 0.08


def shoulders_forward_m(
    side: Silhouette,
    camera: Camera,
    distance_m: float,
    height_m: float,
    span_m: float,
    side_turn: str,
) -> float:
    """Return how far the shoulders are before the hips; 0 if ``side`` does not show the hips.

    ``side`` is a silhouette (H, W), and ``height_m`` the height of the shoulder joints.
    """
    below = (height_m - row_heights_m(side, camera, distance_m)) / span_m
    middles = []
    for first, last in (_CHEST, _HIPS):
        rows = np.nonzero((below >= first) & (below <= last) & side.any(axis=1))[0]
        if len(rows) == 0:
            return 0.0
        ends = [np.nonzero(side[row])[0][[0, -1]] for row in rows]
        points = plane_points_m(camera, np.mean(ends, axis=1), rows, distance_m)
        middles.append(float(np.median(points[:, 0])))
    # A person who turned to the left faces along Y.
    seen = middles[0] - middles[1] if side_turn == "left" else middles[1] - middles[0]
    return _TRUST * float(np.clip(seen, -_FARTHEST_M, _FARTHEST_M))


def robust_mean(readings: FloatArray, sd: FloatArray) -> float:
    """Return the mean of readings (n,), weighted by precision and by Cauchy weights.

    ``sd`` (n,) are their standard deviations. NaN is missing, but not as the first reading.
    """
    known = np.isfinite(readings)
    values, weights = readings[known], sd[known] ** -2.0
    mean = values[0]
    for _ in range(_AVERAGING_STEPS):
        used = weights / (1.0 + ((values - mean) / sd[known] / _OUTLIER_SD) ** 2)  # Cauchy weights
        mean = np.sum(used * values) / np.sum(used)
    return float(mean)
