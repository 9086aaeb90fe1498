"""Compiled depth of a body's visible surface, compared with a measured one at a few points.

Points lie on the axes of the limbs, and on the side of trunk and head that faces the camera. Where
a point's pixel has a measured depth, the difference

    e = measured - expected surface, m

costs e^2 / (e^2 + unit^2) - expected of the area for which the point stands; half of the first
where the measured surface is nearer, since something else may be in front; nothing where nothing
was measured.

Who changes ``whole_body_kernels.py`` has to delete the cache of this file's compiled code.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, Place, PlaceTuple, View, ViewTuple
from cardbox_tracker.estimation.cost.whole_body_kernels import (
    ARM_ANGLES,
    BOTTOM,
    BOTTOM_WIDTH,
    DEPTH,
    FOREARM,
    FORWARD,
    HEAD,
    HEIGHT,
    LEFT_ARM,
    TOP_WIDTH,
    TORSO,
    UPPER_ARM,
    WAIST,
    _new_arm,
    _pose,
    _pose_arm,
    _turn_arm,
)

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)

DepthMap = NDArray[np.float32]

# Points along a limb, as fractions of its length; rows and columns on a part of the trunk, the
# columns as fractions of half its width.
_UPPER_ARM_AT, _FOREARM_AT = (0.35, 0.65, 0.95), (0.25, 0.5, 0.75, 1.0)
_ROWS, _COLUMNS = 4, (-0.6, 0.0, 0.6)
# A limb that points to the camera is not thicker than this times its width.
_THICKEST = 2.0
_OCCLUDED = 0.5


@_inline
def _compare(
    x: float,
    y: float,
    z: float,
    before_m: float,
    view: View,
    depth: Any,
    unit_m: float,
    expected: float,
) -> float:
    """Cost of a surface ``before_m`` in front of the point (x, y, z) of the optical frame."""
    cost = 0.0
    if z > 0.1:
        u = int(view.fx * x / z + view.cx + 0.5)
        v = int(view.fy * y / z + view.cy + 0.5)
        if 0 <= u < depth.shape[1] and 0 <= v < depth.shape[0] and depth[v, u] > 0.0:
            error = depth[v, u] - (z - before_m)
            cost = error * error / (error * error + unit_m * unit_m)
            if error < 0.0:
                cost *= _OCCLUDED
            cost -= expected
    return cost


@_inline
def _limb(
    start: Floats,
    axis: Floats,
    length: float,
    half: float,
    fractions: Any,
    view: View,
    depth: Any,
    unit_m: float,
    expected: float,
) -> float:
    """Mean cost of the points of a limb from ``start`` (3,) along ``axis`` (3,)."""
    total = 0.0
    for fraction in fractions:
        along = fraction * length
        x = start[0] + along * axis[0]
        y = start[1] + along * axis[1]
        z = start[2] + along * axis[2]
        far = sqrt(x * x + y * y + z * z) + 1e-9
        cosine = (x * axis[0] + y * axis[1] + z * axis[2]) / far
        before = half * min(1.0 / sqrt(max(1.0 - cosine * cosine, 1e-6)), _THICKEST)
        total += _compare(x, y, z, before, view, depth, unit_m, expected)
    return total / len(fractions)


@_inline
def _part(
    part: Floats,
    rows: int,
    rotation: Floats,
    hip: Floats,
    view: View,
    depth: Any,
    unit_m: float,
    expected: float,
) -> float:
    """Mean cost of the points on the side of an elliptic frustum that faces the camera.

    Along the level direction v an ellipse with half axes a and b is met 1 / sqrt(vx^2/b^2 +
    vy^2/a^2) before its middle; chords beside it are shorter, with their middles on the diameter
    that joins the two points where v touches it.
    """
    total = 0.0
    b = 0.5 * part[DEPTH]
    for row in range(rows):
        share = (row + 0.5) / rows
        height = part[BOTTOM] + share * part[HEIGHT]
        a = 0.5 * (part[BOTTOM_WIDTH] + share * (part[TOP_WIDTH] - part[BOTTOM_WIDTH]))
        mx = hip[0] + part[FORWARD] * rotation[0, 0] + height * rotation[0, 2]
        my = hip[1] + part[FORWARD] * rotation[1, 0] + height * rotation[1, 2]
        mz = hip[2] + part[FORWARD] * rotation[2, 0] + height * rotation[2, 2]
        vx = rotation[0, 0] * mx + rotation[1, 0] * my + rotation[2, 0] * mz
        vy = rotation[0, 1] * mx + rotation[1, 1] * my + rotation[2, 1] * mz
        norm = sqrt(vx * vx + vy * vy) + 1e-9
        vx, vy = vx / norm, vy / norm
        reach = 1.0 / sqrt(vx * vx / (b * b) + vy * vy / (a * a))
        width = sqrt(b * b * vy * vy + a * a * vx * vx)
        for column in _COLUMNS:
            px, py = -column * b * b * vy / width, column * a * a * vx / width
            x = mx + px * rotation[0, 0] + py * rotation[0, 1]
            y = my + px * rotation[1, 0] + py * rotation[1, 1]
            z = mz + px * rotation[2, 0] + py * rotation[2, 1]
            before = reach * sqrt(1.0 - column * column)
            total += _compare(x, y, z, before, view, depth, unit_m, expected)
    return total / (rows * len(_COLUMNS))


@_compile
def depth_costs(
    states: Floats,
    has_trunk: bool,
    has_left: bool,
    has_right: bool,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    depth: DepthMap,
    areas_px: Floats,
    unit_m: float,
    expected: float,
    costs: Floats,
) -> None:
    """Write the costs (N,), px, of states (N, 14) before a measured depth (H, W), metres.

    ``areas_px`` are those of torso, waist, head, upper arm and forearm, (5,).
    """
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), _new_arm()
    seen = View(*view)
    for i in range(states.shape[0]):
        _pose(states[i], Place(*place), seen, rotation, hip)
        total = 0.0
        if has_trunk:
            found = _part(parts[TORSO], _ROWS, rotation, hip, seen, depth, unit_m, expected)
            total += areas_px[0] * found
            found = _part(parts[WAIST], _ROWS // 2, rotation, hip, seen, depth, unit_m, expected)
            total += areas_px[1] * found
            found = _part(parts[HEAD], _ROWS // 2, rotation, hip, seen, depth, unit_m, expected)
            total += areas_px[2] * found
        for k in range(2):
            if (k == 0 and has_left) or (k == 1 and has_right):
                first = LEFT_ARM + ARM_ANGLES * k
                angles = states[i, first : first + ARM_ANGLES]
                _pose_arm(angles, 1.0 - 2.0 * k, parts, girdle, arm.points, arm.directions)
                _turn_arm(arm, rotation, hip)
                total += areas_px[3] * _limb(
                    arm.joints[0],
                    arm.axes[0],
                    parts[UPPER_ARM, HEIGHT],
                    0.5 * parts[UPPER_ARM, TOP_WIDTH],
                    _UPPER_ARM_AT,
                    seen,
                    depth,
                    unit_m,
                    expected,
                )
                total += areas_px[4] * _limb(
                    arm.joints[1],
                    arm.axes[1],
                    parts[FOREARM, HEIGHT],
                    0.5 * parts[FOREARM, TOP_WIDTH],
                    _FOREARM_AT,
                    seen,
                    depth,
                    unit_m,
                    expected,
                )
        costs[i] = total
