"""Visibility of the last result: near enough, far enough, in the image, not behind the trunk.

The probability of loss was learned from people at about the measured distance, so these limits
are rules of their own.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import NEAREST_M
from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import keypoints
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import SHOULDERS
from cardbox_tracker.terms.body_outline import BODY_PATCHES, TRUNK_PATCHES, corners_of_body
from cardbox_tracker.terms.kernel_arguments import BodyTuple, body_of
from cardbox_tracker.terms.multi_view import MultiViewCost

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


def is_trackable(cost: MultiViewCost, state: FloatArray) -> bool:
    """Return whether at least one camera that sees the person sees enough of a state (14,)."""
    return any(
        _sees_enough(cost.to_views[number](state), cost.costs[number].body, cost.costs[number].size)
        for number in cost.seeing
    )


def are_hidden(cost: MultiViewCost, state: FloatArray) -> BoolArray:
    """Return which keypoints (6,) of a state (14,) no camera sees that sees the person.

    Hidden is what is outside of the image, behind the trunk, of which shoulders are part, or behind
    another person.
    """
    hidden = np.ones(6, dtype=np.bool_)
    for number in cost.seeing:
        one = cost.costs[number]
        own = np.ones(6, dtype=np.bool_)
        there = cost.to_views[number](state)
        _hide_fewer(there, one.body, one.size, own)
        hidden &= own | one.are_covered(there)
    return hidden


@kernel
def _sees_enough(state: FloatArray, body: BodyTuple, size: tuple[int, int]) -> bool:
    """Return whether a camera with an image of ``size``, px, sees enough of a state (14,)."""
    points_m, corners_m = np.empty((6, 3)), np.empty((BODY_PATCHES, 4, 3))
    keypoints(state, body_of(body), points_m)
    left, right = SHOULDERS
    ahead_m = 0.5 * (points_m[left, 2] + points_m[right, 2])
    if ahead_m < NEAREST_TRACKED_M:
        return False
    lens = body_of(body).camera[:4]
    squares_m2 = 0.0
    for axis in range(3):
        squares_m2 += (points_m[left, axis] - points_m[right, axis]) ** 2
    if lens[0] * sqrt(squares_m2) / ahead_m < LEAST_SHOULDERS_PX:
        return False
    corners_of_body(state, body, corners_m)
    count = 0
    for patch in range(TRUNK_PATCHES):
        for corner in range(4):
            count += _is_in_image(corners_m[patch, corner], lens, size)
    return count >= LEAST_IN_IMAGE * 4 * TRUNK_PATCHES


@kernel
def _hide_fewer(
    state: FloatArray, body: BodyTuple, size: tuple[int, int], hidden: BoolArray
) -> None:
    """Clear ``hidden`` (6,) for keypoints of a state (14,) that a camera sees."""
    points_m, corners_m = np.empty((6, 3)), np.empty((BODY_PATCHES, 4, 3))
    keypoints(state, body_of(body), points_m)
    corners_of_body(state, body, corners_m)
    lens = body_of(body).camera[:4]
    for number in range(len(points_m)):
        is_seen = _is_in_image(points_m[number], lens, size)
        if is_seen and number not in SHOULDERS:
            for patch in range(TRUNK_PATCHES):
                is_seen &= not _is_behind(points_m[number], corners_m[patch], lens)
        hidden[number] &= not is_seen


@kernel
def _is_behind(point_m: FloatArray, patch_m: FloatArray, lens: Lens) -> bool:
    """Return whether a point (3,) is in the outline of a patch (4, 3) and behind its plane."""
    u, v = _projected(point_m, lens)
    first_u, first_v = begin_u, begin_v = _projected(patch_m[0], lens)
    lefts, rights = 0, 0
    for corner in range(1, 5):
        end_u, end_v = _projected(patch_m[corner], lens) if corner < 4 else (first_u, first_v)
        side = (end_u - begin_u) * (v - begin_v) - (end_v - begin_v) * (u - begin_u)
        lefts += side >= 0.0
        rights += side <= 0.0
        begin_u, begin_v = end_u, end_v
    # A point is in a convex patch if it is on the same side of all edges.
    if lefts < 4 and rights < 4:
        return False
    # Depth of the plane on the line of sight of the point.
    away, along = 0.0, 0.0
    first, next_m, last_m = patch_m[0], patch_m[1], patch_m[3]
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        normal = (next_m[i] - first[i]) * (last_m[j] - first[j])
        normal -= (next_m[j] - first[j]) * (last_m[i] - first[i])
        away += normal * first[axis]
        along += normal * point_m[axis]
    return bool(point_m[2] > point_m[2] * away / along + BEHIND_M)


@inlined_kernel
def _is_in_image(point_m: FloatArray, lens: Lens, size: tuple[int, int]) -> bool:
    """Return whether a point (3,) is before the camera and in its image."""
    u, v = _projected(point_m, lens)
    is_inside = 0.0 <= u < size[0] and 0.0 <= v < size[1]
    return bool(is_inside and point_m[2] > 0.0)


@inlined_kernel
def _projected(point_m: FloatArray, lens: Lens) -> tuple[float, float]:
    """Return the pixel of a point (3,); its depth counts as at least ``NEAREST_M``."""
    depth_m = max(point_m[2], NEAREST_M)
    fx, fy, cx, cy = lens
    return fx * point_m[0] / depth_m + cx, fy * point_m[1] / depth_m + cy
