"""Arms rated at a few points along their bones: a tenth of the work of drawing them.

A limb is a bar, and a point of its axis speaks for the part of the bar around it. With S the row
sums of what trunk and other arm leave uncovered, the cost of an arm is about

    scale * sum over its points of (pixels of that part) * (S(v, u + 1) - S(v, u))

where (u, v) is the point's pixel: -1 for foreground that is uncovered, 0 for what is covered, 1 for
background. That is enough to tell which of many arms are worth being drawn.

Who changes ``whole_body_kernels.py`` has to delete the cache of compiled code of this file.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, Place, PlaceTuple, View, ViewTuple
from cardbox_tracker.estimation.cost.row_sums import RowSums
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    HEIGHT,
    TOP_WIDTH,
    UPPER_ARM,
    _new_arm,
    _pose,
    _pose_arm,
    _turn_arm,
)

# Points of the upper arm, the elbow among them, and of the forearm, to the end of the fingers.
_POINTS = (3, 4)
# Nearer to the camera nothing is drawn, m.
_NEAREST_M = 0.05


@njit(cache=True, nogil=True, error_model="numpy")
def add_costs_of_arms(
    arms: Floats,
    side: float,
    torso: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    uncovered: RowSums,
    scale: float,
    costs: Floats,
) -> None:
    """Add the approximate costs of arms (N, 4) beside the state ``torso`` (14,) to ``costs`` (N,).

    Args:
        arms: angles, rad.
        side: 1 for the left arm, -1 for the right.
        torso: state whose trunk the arms are at.
        parts: the measured parts, (6, 6), metres.
        drawn: those whose outlines are drawn, (6, 6), metres.
        girdle: where the shoulders are, (5,).
        place: where the hips are in the body model.
        view: the camera.
        uncovered: row sums beside trunk and other arm, (rows, W + 1).
        scale: 1 / (pixels of the silhouette).
        costs: shares of the silhouette.
    """
    rows, width = uncovered.shape[0], uncovered.shape[1] - 1
    rotation, hip, arm, lens = np.empty((3, 3)), np.empty(3), _new_arm(), View(*view)
    _pose(torso, Place(*place), lens, rotation, hip)
    for i in range(arms.shape[0]):
        _pose_arm(arms[i], side, parts, girdle, arm.points, arm.directions)
        _turn_arm(arm, rotation, hip)
        total = 0.0
        for limb in range(2):
            joint, axis = arm.joints[limb], arm.axes[limb]
            long_m, wide_m = drawn[UPPER_ARM + limb, HEIGHT], drawn[UPPER_ARM + limb, TOP_WIDTH]
            far_m = max(joint[2] + 0.5 * long_m * axis[2], _NEAREST_M)
            # How long the limb looks: what of its axis lies across the line of sight.
            across = axis[0] - axis[2] * joint[0] / far_m
            down = axis[1] - axis[2] * joint[1] / far_m
            seen_m = sqrt(across * across + down * down) * long_m + 0.5 * wide_m
            part_px = seen_m * wide_m * lens.fx * lens.fy / (far_m * far_m * _POINTS[limb])
            for k in range(_POINTS[limb]):
                along_m = long_m * (k + 1.0) / _POINTS[limb]
                ahead_m = joint[2] + along_m * axis[2]
                if ahead_m < _NEAREST_M:
                    continue
                column = lens.fx * (joint[0] + along_m * axis[0]) / ahead_m + lens.cx + 0.5
                row = lens.fy * (joint[1] + along_m * axis[1]) / ahead_m + lens.cy + 0.5
                if 0.0 <= column < width and 0.0 <= row < rows:
                    u, v = int(column), int(row)
                    total += part_px * (uncovered[v, u + 1] - uncovered[v, u])
        costs[i] += scale * total
