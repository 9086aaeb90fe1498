"""Compiled comparison of a body's visible surface with a depth image at a few points.

Points lie on the axes of the limbs, and on the side of trunk and head that faces the camera. Where
a point's pixel has a measured depth, the difference

    e = measured - expected surface, m

costs e^2 / (e^2 + unit^2) - expected, times the area that the point represents. The fraction is
halved if the measured surface is nearer, because another object may be in front. A point without a
measured depth costs nothing.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)
from cardbox_tracker.person.parts import (
    BOTTOM,
    BOTTOM_WIDTH,
    DEPTH,
    FOREARM,
    FORWARD,
    HEAD,
    HEIGHT,
    TOP_WIDTH,
    TORSO,
    UPPER_ARM,
    WAIST,
)
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Drawn, Floats, Intrinsics, body_of

DepthMap = NDArray[np.float32]

# Points along a limb, as fractions of its length; rows of points on a part of the trunk, and
# columns as fractions of half its width.
_UPPER_ARM_AT, _FOREARM_AT = (0.35, 0.65, 0.95), (0.25, 0.5, 0.75, 1.0)
_ROWS, _COLUMNS = 4, (-0.6, 0.0, 0.6)
# Largest thickness of a limb that points to the camera, in widths of the limb.
_THICKEST = 2.0
_OCCLUDED = 0.5


class Surface(NamedTuple):
    """A measured surface and the costs of differences from it."""

    depth: DepthMap  #: (H, W), metres along the optical axis; 0 if unknown
    areas_px: Floats  #: areas of torso, waist, head, upper arm and forearm, (5,)
    unit_m: float  #: difference that costs 0.5
    expected: float  #: mean cost of a point, which is subtracted


SurfaceTuple = tuple[DepthMap, Floats, float, float]


@inlined_kernel
def _compare(
    x: float,
    y: float,
    z: float,
    before_m: float,
    camera: Intrinsics,
    surface: Surface,
) -> float:
    """Return the cost of a surface ``before_m`` in front of the optical point (x, y, z)."""
    cost, depth = 0.0, surface.depth
    if z > 0.1:
        u = int(camera.fx * x / z + camera.cx + 0.5)
        v = int(camera.fy * y / z + camera.cy + 0.5)
        if 0 <= u < depth.shape[1] and 0 <= v < depth.shape[0] and depth[v, u] > 0.0:
            error = depth[v, u] - (z - before_m)
            cost = error * error / (error * error + surface.unit_m * surface.unit_m)
            if error < 0.0:
                cost *= _OCCLUDED
            cost -= surface.expected
    return cost


@inlined_kernel
def _limb(
    start: Floats,
    axis: Floats,
    length: float,
    half: float,
    fractions: Any,
    camera: Intrinsics,
    surface: Surface,
) -> float:
    """Return the mean cost of the points of a limb from ``start`` (3,) along ``axis`` (3,)."""
    total = 0.0
    for fraction in fractions:
        along = fraction * length
        x = start[0] + along * axis[0]
        y = start[1] + along * axis[1]
        z = start[2] + along * axis[2]
        far = sqrt(x * x + y * y + z * z) + 1e-9
        cosine = (x * axis[0] + y * axis[1] + z * axis[2]) / far
        before = half * min(1.0 / sqrt(max(1.0 - cosine * cosine, 1e-6)), _THICKEST)
        total += _compare(x, y, z, before, camera, surface)
    return total / len(fractions)


@inlined_kernel
def _part(
    part: Floats,
    rows: int,
    rotation: Floats,
    hip: Floats,
    camera: Intrinsics,
    surface: Surface,
) -> float:
    """Return the mean cost of points on the side of an elliptic frustum that faces the camera.

    A line through the middle along the level direction v meets an ellipse with half axes a and b at
    a distance 1 / sqrt(vx^2/b^2 + vy^2/a^2) from the middle. Parallel chords are shorter; their
    middles lie on the diameter between the two points at which v is tangent.
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
            total += _compare(x, y, z, before, camera, surface)
    return total / (rows * len(_COLUMNS))


@kernel
def depth_costs(
    states: Floats, drawn: Drawn, body: BodyTuple, measured: SurfaceTuple, costs: Floats
) -> None:
    """Write the costs (N,), px, of the ``drawn`` parts of states (N, 14) against a ``Surface``."""
    of, surface = body_of(body), Surface(*measured)
    parts, camera, areas_px = of.parts, of.camera, surface.areas_px
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), new_arm()
    upper_m, upper_half_m = parts[UPPER_ARM, HEIGHT], 0.5 * parts[UPPER_ARM, TOP_WIDTH]
    fore_m, fore_half_m = parts[FOREARM, HEIGHT], 0.5 * parts[FOREARM, TOP_WIDTH]
    for i in range(states.shape[0]):
        state_pose(states[i], of.place, camera, rotation, hip)
        total = 0.0
        if drawn[0]:
            total += areas_px[0] * _part(parts[TORSO], _ROWS, rotation, hip, camera, surface)
            total += areas_px[1] * _part(parts[WAIST], _ROWS // 2, rotation, hip, camera, surface)
            total += areas_px[2] * _part(parts[HEAD], _ROWS // 2, rotation, hip, camera, surface)
        for k in range(2):
            if drawn[1 + k]:
                angles = angles_in(states[i], k)
                pose_arm(angles, side_of(k), parts, of.girdle, arm.points, arm.directions)
                turn_arm(arm, rotation, hip)
                upper, fore = arm.joints[0], arm.joints[1]
                total += areas_px[3] * _limb(
                    upper, arm.axes[0], upper_m, upper_half_m, _UPPER_ARM_AT, camera, surface
                )
                total += areas_px[4] * _limb(
                    fore, arm.axes[1], fore_m, fore_half_m, _FOREARM_AT, camera, surface
                )
        costs[i] = total
