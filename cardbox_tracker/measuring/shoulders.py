"""Height and depth of the shoulder joints from the outlines of all three reference postures.

The height has three readings, which err for different reasons and are averaged by
:func:`robust_mean`: the axes of the level arms in ``arms`` (sleeves hang), the top of the shoulders
in ``front`` (collars, bags), and the crown of the head (hair, hats).

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

SHOULDER_TOP = 0.040
"""Height of the outline above the shoulder joint, at the joint's column, in spans: the mean of two
families of rendered bodies with clothes, which have 0.047 and 0.035."""

CROWN = 0.219
"""Height of the crown with hair above the shoulder joints in spans; 0.22 in both families."""

# Standard deviations in spans: height from the axes, from the top of either shoulder, the crown.
_HEIGHT_SD = np.array([0.008, 0.025, 0.025, 0.030])
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


def shoulder_height_m(
    front: Silhouette,
    camera: Camera,
    distance_m: float,
    raised_m: float,
    middle_m: float,
    breadth_m: float,
    span_m: float,
) -> float:
    """Return the height of the shoulder joints while the arms hang.

    ``raised_m`` is the height of the axes of the level arms of ``arms`` at the joints, ``middle_m``
    the Y of the middle of the shoulders in ``front``.
    """
    sides_m = middle_m + np.array([-0.5, 0.5]) * breadth_m
    tops_m = [top_m(front, camera, distance_m, y) for y in sides_m]
    rows = np.nonzero(front.any(axis=1))[0]
    crown_m = row_heights_m(front, camera, distance_m)[rows[0]] if len(rows) else np.nan
    readings = np.array(
        [
            raised_m - GIRDLE_RISE * breadth_m,
            *(top - SHOULDER_TOP * span_m for top in tops_m),
            crown_m - CROWN * span_m,
        ]
    )
    return robust_mean(readings, _HEIGHT_SD * span_m)


def top_m(silhouette: Silhouette, camera: Camera, distance_m: float, y_m: float) -> float:
    """Return the height of the upper edge of a silhouette at ``y_m``; NaN without foreground."""
    columns = np.nonzero(silhouette.any(axis=0))[0]
    if len(columns) == 0:
        return float("nan")
    rows = np.argmax(silhouette[:, columns] > 0, axis=0) - 0.5
    points = plane_points_m(camera, columns, rows, distance_m)
    order = np.argsort(points[:, 0])
    return float(np.interp(y_m, points[order, 0], points[order, 1], left=np.nan, right=np.nan))


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
