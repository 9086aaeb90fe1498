"""Visibility of the last result: near enough, far enough, in the image, not behind the trunk.

The probability of loss was learned from people at about the measured distance, so these limits
are rules of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.body_outline import TRUNK_PATCHES
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost

BoolArray = NDArray[np.bool_]
Lens = tuple[float, float, float, float]
"""Focal lengths and principal point, px."""

NEAREST_TRACKED_M = 0.8
"""Depth of the shoulders below which a posture is uncertain, metres."""
LEAST_SHOULDERS_PX = 15.0
"""Breadth of the shoulders, seen from the front, below which a posture is uncertain, px."""
LEAST_IN_IMAGE = 0.6
"""Part of trunk and head in the image below which a posture is uncertain."""
BEHIND_M = 0.08
"""Distance behind the middle plane of the trunk from which the trunk hides a keypoint, m."""

_SHOULDERS = [0, 3]
_NEAREST_M = 1e-3


def is_trackable(cost: MultiViewCost, state: FloatArray) -> bool:
    """Return whether at least one camera that sees the person sees enough of a state (14,)."""
    return any(_sees_enough(cost, number, state) for number in cost.seeing)


def _sees_enough(cost: MultiViewCost, number: int, state: FloatArray) -> bool:
    one, there = cost.costs[number], cost.to_views[number](state)
    shoulders_m = one.keypoints(there)[_SHOULDERS]
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


def are_hidden(cost: MultiViewCost, state: FloatArray) -> BoolArray:
    """Return which keypoints (6,) of a state (14,) no camera sees that sees the person.

    A keypoint is hidden outside of the image and behind the trunk; shoulders are part of the trunk.
    """
    hidden = np.ones(6, dtype=np.bool_)
    for number in cost.seeing:
        there = cost.to_views[number](state)
        hidden &= _are_hidden_before(cost.costs[number], there)
    return hidden


def _are_hidden_before(cost: WholeBodyCost, state: FloatArray) -> BoolArray:
    points_m, trunk_m = cost.keypoints(state), cost.corners(state)[:TRUNK_PATCHES]
    fx, fy, cx, cy = cost.view[:4]
    lens = fx, fy, cx, cy
    # A point is in a convex patch if it is on the same side of all edges.
    corners = _projected(trunk_m, lens)
    edges = np.roll(corners, -1, axis=1) - corners
    away = _projected(points_m, lens)[:, None, None] - corners
    sides = edges[..., 0] * away[..., 1] - edges[..., 1] * away[..., 0]
    in_patch = (sides >= 0.0).all(axis=2) | (sides <= 0.0).all(axis=2)
    # Depth of each patch's plane on the line of sight of each point.
    normals = np.cross(trunk_m[:, 1] - trunk_m[:, 0], trunk_m[:, 3] - trunk_m[:, 0])
    along = points_m @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        plane_m = points_m[:, 2:] * np.sum(normals * trunk_m[:, 0], axis=1) / along
    behind = (in_patch & (points_m[:, 2:] > plane_m + BEHIND_M)).any(axis=1)
    behind[_SHOULDERS] = False
    hidden: BoolArray = behind | ~_are_in_image(points_m, lens, cost.size)
    return hidden


def part_in_image(corners_m: FloatArray, lens: Lens, size: tuple[int, int]) -> float:
    """Return the share of corners (..., 3), metres in the optical frame, that are in an image.

    Args:
        corners_m: the corners.
        lens: focal lengths and principal point, px.
        size: width and height of the image, px.
    """
    return float(_are_in_image(corners_m, lens, size).mean())


def _are_in_image(points_m: FloatArray, lens: Lens, size: tuple[int, int]) -> BoolArray:
    """Return which points (..., 3) are before the camera and in its image."""
    pixels = _projected(points_m, lens)
    inside: BoolArray = np.asarray(((pixels >= 0.0) & (pixels < size)).all(axis=-1))
    return inside & (points_m[..., 2] > 0.0)


def _projected(points_m: FloatArray, lens: Lens) -> FloatArray:
    """Return the pixels (..., 2) of points (..., 3); depths are at least ``_NEAREST_M``."""
    depth_m = np.maximum(points_m[..., 2:], _NEAREST_M)
    pixels: FloatArray = np.asarray(lens[:2]) * points_m[..., :2] / depth_m + lens[2:]
    return pixels
