"""Where the shoulder joints are and how long the arms, from the outlines of ``front`` and ``arms``.

A fit of all 18 sizes at once finds arms 5 to 10 % too long and shoulders 2 cm too high: the girdle
lifts the shoulders in ``arms``, open fingers reach beyond the fist, and nothing in the outline of a
straight arm shows the elbow. So the bones of the arms are measured before the fit, from what the
outline does show, with the proportions of people for the rest:

1. Each arm of ``arms`` is followed from the fingertips to the armpit; a line through its middle is
   the arm's axis. The span goes from fingertip to fingertip.
2. The axes pass by the shoulder joints. They are lower when the arms hang, by the rise of the
   girdle.
3. The breadth is read three times: where the axes of the hanging arms of ``front`` reach the
   joints' height, from the width of the shoulders there, and from the span. The three are averaged
   by their precision; one that contradicts the others counts less.
4. What the span leaves beside the breadth is the reach of the arms, shared among upper arm,
   forearm and fingers as people's arms are.

Constants without a source were chosen on about 200 rendered bodies whose joint centres are known.
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
"""How much higher the shoulder joints are in ``arms`` than in ``front``, of their breadth.

The clavicle is about 0.43 of the breadth long, since its inner ends are close to each other, and
rises by about 9 degrees until the arm is at 80 degrees (Inman, Saunders & Abbott, "Observations on
the Function of the Shoulder Joint", 1944).
"""

KNUCKLES_SHARE = 0.874
"""Shoulder to the knuckles at the base of the fingers, of shoulder to fingertips.

Mean of 60 rendered bodies (standard deviation 0.7 %); 0.862 in men and 0.868 in women after de
Leva, "Adjustments to Zatsiorsky-Seluyanov's Segment Inertia Parameters", 1996.
"""

UPPER_ARM_SHARE = 0.420
"""Upper arm, of shoulder to knuckles, at the mean ratio of hip width to shoulder breadth.

Mean of 214 rendered bodies (standard deviation 3.5 %); 0.442 in men and 0.446 in women after de
Leva, whose joint centres are defined differently.
"""

BREADTH_OF_SPAN = 0.204
"""Distance of the shoulder joints, of the span (rendered bodies)."""

# Whose hips are wide beside the shoulders has a short forearm beside the upper arm: an exponent of
# 0.2 on the rendered bodies, taken smaller and never more than 3 % of the share, for clothes widen
# the hips.
_HIP_RATIO, _HIP_EXPONENT, _HIP_EFFECT = 1.042, 0.15, 0.03
# Axis of the outline of a level arm below its shoulder joint, of the span.
_AXIS_BELOW_JOINT = 0.0034
# Where the width of the shoulders is read, below the arms' axes, of the span.
_SHOULDERS_BELOW = 0.02
# Where the hips are widest, below the shoulder joints, of the span.
_HIPS_BELOW = 0.28
# The fingertips bend down and are nearer than the body, so that less of the span is the arms'.
_SPAN_IN_PLANE = 0.980
# The breadth by each reading, and the standard deviation of span, axes and width, as a fraction.
_BREADTH_OF_AXES, _BREADTH_OF_WIDTH = 1.044, 0.733
_BREADTH_SD = np.array([0.05, 0.031, 0.046])
# A reading counts half of its weight where it is so many standard deviations off the mean.
_OUTLIER_SD = 1.5
_AVERAGING_STEPS = 10


@dataclass(frozen=True)
class Skeleton:
    """The arms' bones, metres.

    Attributes:
        shoulder_breadth_m: between the shoulder joints.
        shoulder_height_m: of the shoulder joints above the camera's centre, arms hanging.
        upper_arm_m: shoulder joint to elbow joint.
        forearm_m: elbow joint to the knuckles.
        span_m: fingertip to fingertip in ``arms``.
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
        camera: the working camera, pitched as it is.
        distance_m: level distance to the person.

    Returns:
        None if no arms are found in ``arms``.
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
    # The height takes a breadth, which takes a height: the span's breadth is good enough for that.
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
    """Average readings by their precision; one that is far off the others counts less.

    Args:
        readings: shape (n,), above 0; NaN where there is none. The first one is there.
        sd: their standard deviations (n,) as fractions.
    """
    known = np.isfinite(readings) & (readings > 0)
    logs, weights = np.log(readings[known]), sd[known] ** -2.0
    mean = logs[0]
    for _ in range(_AVERAGING_STEPS):
        used = weights / (1.0 + ((logs - mean) / sd[known] / _OUTLIER_SD) ** 2)  # Cauchy weights
        mean = np.sum(used * logs) / np.sum(used)
    return float(np.exp(mean))


def effect_of_hips(ratio: float) -> float:
    """Return the factor on the upper arm's share for a ratio of hip width to shoulder breadth.

    It is 1 where the ratio is not known (NaN).
    """
    if not np.isfinite(ratio):
        return 1.0
    log = _HIP_EXPONENT * np.log(ratio / _HIP_RATIO)
    return float(np.exp(np.clip(log, -_HIP_EFFECT, _HIP_EFFECT)))
