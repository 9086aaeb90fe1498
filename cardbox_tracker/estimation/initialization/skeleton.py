"""Shoulder joints and arm lengths from the outlines of ``front`` and ``arms``.

A fit of all 18 sizes at once is biased: the girdle lifts the shoulders in ``arms``, open fingers
reach beyond the fist, and the outline of a straight arm does not show the elbow. So the bones of
the arms are measured before the fit, with the proportions of people:

1. Each arm of ``arms`` is traced from the fingertips to the armpit; a line through its middle is
   the arm's axis. The span is the distance between the fingertips.
2. The shoulder joints lie near the axes, and lower by the lift of the girdle if the arms hang.
3. The breadth has three readings: the distance of the axes of the hanging arms in ``front`` at the
   joints' height, the width of the shoulders there, and the span. They are averaged by their
   precision, with less weight for outliers.
4. The span minus the breadth is the reach of the arms, which is divided into upper arm, forearm
   and fingers by mean proportions.

Constants without a source were chosen on rendered bodies with known joint centres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.initialization.outline import (
    axes_distance_m,
    level_arm,
    span_m,
    trunk_width_m,
    width_m,
)
from cardbox_tracker.vision.camera import Camera

FloatArray = NDArray[np.float64]
Silhouette = NDArray[np.uint8]

GIRDLE_RISE = 0.068
"""Lift of the shoulder joints from ``front`` to ``arms`` in shoulder breadths.

The clavicle has a length of about 0.43 breadths and rises by about 9 degrees until the arm is at 80
degrees (Inman, Saunders & Abbott, "Observations on the Function of the Shoulder Joint", 1944).
"""

KNUCKLES_SHARE = 0.874
"""Distance from shoulder to knuckles, divided by the distance from shoulder to fingertips.

Mean of rendered bodies; 0.862 for men and 0.868 for women by de Leva, "Adjustments to
Zatsiorsky-Seluyanov's Segment Inertia Parameters", 1996.
"""

UPPER_ARM_SHARE = 0.420
"""Length of the upper arm, divided by the distance from shoulder to knuckles, at the mean ratio of
hip width to shoulder breadth.

Mean of rendered bodies; 0.442 for men and 0.446 for women by de Leva, with other joint centres.
"""

BREADTH_OF_SPAN = 0.204
"""Distance of the shoulder joints in spans (rendered bodies)."""

# Mean ratio of hip width to shoulder breadth; the upper arm's share grows with a power of that
# ratio, by a limited factor because clothes widen the hips.
_HIP_RATIO, _HIP_EXPONENT, _HIP_EFFECT = 1.042, 0.15, 0.03
# Height of the shoulder joint above the axis of a level arm in spans.
_AXIS_BELOW_JOINT = 0.0034
# Row of the shoulders' width below the arms' axes in spans.
_SHOULDERS_BELOW = 0.02
# Row of the widest hips below the shoulder joints in spans.
_HIPS_BELOW = 0.28
# Correction of the span for fingertips that bend down and are nearer to the camera than the body.
_SPAN_IN_PLANE = 0.980
# Factors from axes distance and width to breadth; relative deviations by span, axes and width.
_BREADTH_OF_AXES, _BREADTH_OF_WIDTH = 1.044, 0.733
_BREADTH_SD = np.array([0.05, 0.031, 0.046])
# Distance from the mean, in standard deviations, at which a reading has half of its weight.
_OUTLIER_SD = 1.5
_AVERAGING_STEPS = 10


@dataclass(frozen=True)
class Skeleton:
    """The bones of the arms, metres.

    Attributes:
        shoulder_breadth_m: distance between the shoulder joints.
        shoulder_height_m: height of the shoulder joints, with hanging arms, above the camera.
        upper_arm_m: distance from shoulder joint to elbow joint.
        forearm_m: distance from elbow joint to knuckles.
        span_m: distance from fingertip to fingertip in ``arms``.
    """

    shoulder_breadth_m: float
    shoulder_height_m: float
    upper_arm_m: float
    forearm_m: float
    span_m: float


def measure_skeleton(
    references: Mapping[str, Silhouette], camera: Camera, distance_m: float
) -> Skeleton | None:
    """Measure the bones of the arms.

    Args:
        references: silhouettes (H, W) of ``front`` and ``arms``, as ``outline.filled`` returns
            them.
        camera: working camera including the pitch.
        distance_m: level distance to the person.

    Returns:
        None if ``arms`` shows no arms.
    """
    front, arms = references["front"], references["arms"]
    right, left = (level_arm(arms, camera, distance_m, side) for side in (-1, 1))
    if left is None or right is None:
        return None
    span = span_m(arms, camera, distance_m, left, right)
    centre = (left.tip_m + right.tip_m) / 2.0
    half = BREADTH_OF_SPAN * span / 2.0
    axis = float(np.mean([left.axis_m(centre + half), right.axis_m(centre - half)]))
    raised = axis + _AXIS_BELOW_JOINT * span
    # Height and breadth depend on each other; the first height uses the breadth from the span.
    height = raised - GIRDLE_RISE * 2.0 * half
    readings = [
        BREADTH_OF_SPAN * span,
        _BREADTH_OF_AXES * axes_distance_m(front, camera, distance_m, axis, height, span, left),
        _BREADTH_OF_WIDTH * width_m(front, camera, distance_m, axis - _SHOULDERS_BELOW * span),
    ]
    breadth = combined(np.array(readings), _BREADTH_SD)
    height = raised - GIRDLE_RISE * breadth
    drop = np.arctan((abs(left.slope) + abs(right.slope)) / 2.0)
    reach = KNUCKLES_SHARE * (_SPAN_IN_PLANE * span - breadth) / 2.0 / float(np.cos(drop))
    hips = trunk_width_m(arms, camera, distance_m, height - _HIPS_BELOW * span, centre)
    upper_arm = reach * UPPER_ARM_SHARE * effect_of_hips(hips / breadth)
    return Skeleton(breadth, height, upper_arm, reach - upper_arm, span)


def combined(readings: FloatArray, sd: FloatArray) -> float:
    """Return the mean of readings, weighted by precision and by Cauchy weights.

    Args:
        readings: shape (n,), above 0; NaN if missing. The first reading must not be missing.
        sd: relative standard deviations (n,).
    """
    known = np.isfinite(readings) & (readings > 0)
    logs, weights = np.log(readings[known]), sd[known] ** -2.0
    mean = logs[0]
    for _ in range(_AVERAGING_STEPS):
        used = weights / (1.0 + ((logs - mean) / sd[known] / _OUTLIER_SD) ** 2)  # Cauchy weights
        mean = np.sum(used * logs) / np.sum(used)
    return float(np.exp(mean))


def effect_of_hips(ratio: float) -> float:
    """Return the factor of the upper arm's share for a ratio of hip width to shoulder breadth.

    The factor is 1 if the ratio is NaN.
    """
    if not np.isfinite(ratio):
        return 1.0
    log = _HIP_EXPONENT * np.log(ratio / _HIP_RATIO)
    return float(np.exp(np.clip(log, -_HIP_EFFECT, _HIP_EFFECT)))
