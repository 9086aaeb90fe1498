"""Shoulder joints and arm lengths from the outlines of the reference postures.

A fit of all 18 sizes at once is biased: the girdle lifts the shoulders in ``arms``, open fingers
reach beyond the fist, and the outline of a straight arm does not show the elbow. So the bones of
the arms are measured before the fit, with the proportions of people:

1. Each arm of ``arms`` is traced from the fingertips to the armpit; a line through its middle,
   without what hangs of a sleeve, is the arm's axis. The span is the distance between the
   fingertips.
2. The height of the shoulder joints and their depth against the hips are those of
   :mod:`.shoulders`. Arms and shoulders are nearer than the hips by that depth.
3. The breadth has three readings: the distance of the axes of the hanging arms in ``front`` at the
   joints' height, the width of the shoulders there, and the span. They are averaged by their
   precision, with less weight for outliers.
4. The span minus the breadth is the reach of the arms, which is divided into upper arm, forearm
   and fingers by mean proportions.

Proportions are from anthropometry where it has them. Where rendered bodies differ from it, whose
joints are known exactly but were placed by artists, the mean of three sources is taken: the
literature, MakeHuman and Microsoft Rocketbox. docs/research.md#sizes has the figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.outline import axes_distance_m, level_arm, span_m, width_m
from cardbox_tracker.measuring.references import Silhouette, lateral_m
from cardbox_tracker.measuring.shoulders import robust_mean, shoulder_height_m, shoulders_forward_m
from cardbox_tracker.person.sizes import FloatArray

KNUCKLES_SHARE = 0.876
"""Distance from shoulder to knuckles, divided by the distance from shoulder to fingertips.

0.862 for men and 0.868 for women by de Leva, "Adjustments to Zatsiorsky-Seluyanov's Segment Inertia
Parameters", 1996, with straight fingers; 0.882 in rendered bodies of either family.
"""

UPPER_ARM_SHARE = 0.432
"""Length of the upper arm, divided by the distance from shoulder to knuckles.

0.442 for men and 0.446 for women by de Leva; 0.436 (Rocketbox) and 0.422 (MakeHuman) in rendered
bodies. No outline shows the elbow, and the share depends little on sex or build.
"""

BREADTH_OF_SPAN = 0.207
"""Distance of the shoulder joints in spans: 0.209 in MakeHuman, 0.218 in Rocketbox, and 0.193 for a
biacromial breadth less 3 cm on either side (ANSUR II)."""

# Row of the shoulders' width below the arms' axes in spans.
_SHOULDERS_BELOW = 0.02
# Correction of the span for fingertips that bend down and are nearer to the camera than the body.
_SPAN_IN_PLANE = 0.99
# Factors from axes distance and width to breadth; relative deviations by span, axes and width.
_BREADTH_OF_AXES, _BREADTH_OF_WIDTH = 1.010, 0.737
_BREADTH_SD = np.array([0.05, 0.031, 0.046])


@dataclass(frozen=True)
class Skeleton:
    """The bones of the arms, metres."""

    shoulder_breadth_m: float  #: distance between the shoulder joints
    shoulder_height_m: float  #: height of the shoulder joints, with hanging arms, above the camera
    upper_arm_m: float  #: distance from shoulder joint to elbow joint
    forearm_m: float  #: distance from elbow joint to knuckles
    span_m: float  #: distance from fingertip to fingertip in ``arms``
    forward_m: float = 0.0  #: how far the shoulder joints are before the hips


def measure_skeleton(
    references: Mapping[str, Silhouette],
    camera: Camera,
    distance_m: float,
    side_turn: str = "left",
) -> Skeleton | None:
    """Measure the bones of the arms; None if ``arms`` shows no arms.

    ``references`` are silhouettes (H, W) as ``outline.filled`` returns them. The camera includes
    its pitch, and the distance is the level one to the hips.
    """
    first = _measured_in_plane(references, camera, distance_m)
    if first is None:
        return None
    forward = shoulders_forward_m(
        references["side"], camera, distance_m, first.shoulder_height_m, first.span_m, side_turn
    )
    found = _measured_in_plane(references, camera, distance_m - forward)
    return None if found is None else replace(found, forward_m=forward)


def _measured_in_plane(
    references: Mapping[str, Silhouette], camera: Camera, distance_m: float
) -> Skeleton | None:
    """Measure the bones of arms in the upright plane at a level distance."""
    front, arms = references["front"], references["arms"]
    right, left = (level_arm(arms, camera, distance_m, side) for side in (-1, 1))
    if left is None or right is None:
        return None
    span = span_m(arms, camera, distance_m, left, right)
    centre = (left.tip_m + right.tip_m) / 2.0
    breadth = BREADTH_OF_SPAN * span
    half = breadth / 2.0
    axis = float(np.mean([left.axis_m(centre + half), right.axis_m(centre - half)]))
    middle = lateral_m(front, camera, distance_m)
    # Height and breadth depend on each other; the first height uses the breadth from the span.
    for _ in range(2):
        height = shoulder_height_m(front, camera, distance_m, axis, middle, breadth, span)
        readings = [
            BREADTH_OF_SPAN * span,
            _BREADTH_OF_AXES * axes_distance_m(front, camera, distance_m, axis, height, span, left),
            _BREADTH_OF_WIDTH * width_m(front, camera, distance_m, axis - _SHOULDERS_BELOW * span),
        ]
        breadth = combined(np.array(readings), _BREADTH_SD)
    drop = np.arctan((abs(left.slope) + abs(right.slope)) / 2.0)
    reach = KNUCKLES_SHARE * (_SPAN_IN_PLANE * span - breadth) / 2.0 / float(np.cos(drop))
    upper_arm = reach * UPPER_ARM_SHARE
    return Skeleton(breadth, height, upper_arm, reach - upper_arm, span)


def combined(readings: FloatArray, sd: FloatArray) -> float:
    """Return the robust mean of lengths (n,) above 0, by relative deviations (n,).

    NaN is missing, but not as the first reading.
    """
    logs = np.log(np.where(readings > 0, readings, np.nan))
    return float(np.exp(robust_mean(logs, sd)))
