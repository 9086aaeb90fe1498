"""Whether a person can be tracked where the last result is: near enough, far enough, in the image.

The probability of loss was learned from people at about the measured distance, so these limits
are rules of their own.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.body_outline import TRUNK_PATCHES
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost

NEAREST_TRACKED_M = 0.8
"""Depth of the shoulders below which a posture is uncertain, metres."""
LEAST_SHOULDERS_PX = 15.0
"""Breadth of the shoulders, seen from the front, below which a posture is uncertain, px."""
LEAST_IN_IMAGE = 0.6
"""Part of trunk and head in the image below which a posture is uncertain."""

_LEFT, _RIGHT = 0, 3


def is_trackable(cost: MultiViewCost, state: FloatArray) -> bool:
    """Return whether at least one camera that sees the person sees enough of a state (14,)."""
    return any(_sees_enough(cost, number, state) for number in cost.seeing)


def _sees_enough(cost: MultiViewCost, number: int, state: FloatArray) -> bool:
    one, there = cost.costs[number], cost.to_views[number](state)
    shoulders_m = one.keypoints(there)[[_LEFT, _RIGHT]]
    ahead_m = float(shoulders_m[:, 2].mean())
    if ahead_m < NEAREST_TRACKED_M:
        return False
    breadth_m = float(np.linalg.norm(shoulders_m[0] - shoulders_m[1]))
    fx, fy, cx, cy = one.view[:4]
    if fx * breadth_m / ahead_m < LEAST_SHOULDERS_PX:
        return False
    return part_in_image(one.corners(there)[:TRUNK_PATCHES], (fx, fy, cx, cy), one.size) >= (
        LEAST_IN_IMAGE
    )


def part_in_image(
    corners_m: FloatArray, lens: tuple[float, float, float, float], size: tuple[int, int]
) -> float:
    """Return the share of corners (..., 3), metres in the optical frame, that are in an image.

    Args:
        corners_m: the corners.
        lens: focal lengths and principal point, px.
        size: width and height of the image, px.
    """
    points_m = corners_m.reshape(-1, 3)
    fx, fy, cx, cy = lens
    depth_m = np.maximum(points_m[:, 2], 1e-3)
    columns, rows = fx * points_m[:, 0] / depth_m + cx, fy * points_m[:, 1] / depth_m + cy
    inside = (points_m[:, 2] > 0.0) & (columns >= 0.0) & (columns < size[0])
    inside &= (rows >= 0.0) & (rows < size[1])
    return float(inside.mean())
