"""Compiled residuals, and the fit, of both legs to what one image shows; :mod:`.legs` has the cost.

Values (12,) are the angles of the left and of the right leg, the logarithms of the factors of
thigh and shank, the height of the floor, and the logarithm of the factor of the distance.
"""

from __future__ import annotations

from math import cos, exp, inf, isnan, sin, sqrt

import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M
from cardbox_tracker.common.compiling import borrowing_kernel, inlined_kernel, kernel
from cardbox_tracker.common.least_squares import (
    DIFFERENCE,
    ENDS,
    Equations,
    Solution,
    minimize_compiled,
    rules_of,
)
from cardbox_tracker.person.proportions import MASS_SHARES
from cardbox_tracker.person.skeleton import LEG_LIMITS
from cardbox_tracker.terms.kernel_arguments import Floats

LENGTHS = N_ANGLES = len(LEG_LIMITS)
FLOOR = LENGTHS + 2
DISTANCE, N_VALUES = FLOOR + 1, FLOOR + 2
REST = np.tile(np.radians([60.0, 15.0, 15.0, 60.0]), 2)
"""Deviations of the angles from those of hanging legs, (8,), rad."""
# Of each leg: two points in the image, two slopes, and the foot; then the priors and the balance.
_OF_LEG = 7
_N_RESIDUALS = 2 * _OF_LEG + 2 * N_ANGLES + 4 + 1
# Deviation of a foot on the floor, m, and height above it from which a foot is lifted rather.
_CONTACT_M, _LIFTED_M = 0.02, 0.06
# How far the middle of the mass of somebody who stands is ahead of the ankles, m.
_AHEAD_M = 0.05
_OF_SHOULDERS, _OF_HIPS, _OF_KNEES, _OF_ANKLES = MASS_SHARES
# Lowest and highest values; the lengths of people are within 12 %, floor and distance are free.
_LOWEST = np.array([*LEG_LIMITS[:, 0], -0.12, -0.12, -inf, -inf])
_HIGHEST = np.array([*LEG_LIMITS[:, 1], 0.12, 0.12, inf, inf])
_RULES = rules_of(N_VALUES, low=_LOWEST, high=_HIGHEST, largest=0.6)

Person = tuple[Floats, Floats, Floats, Floats, float]
"""The hips (3,) and the left one from their middle (3,), metres in the reference frame; the
rotation (3, 3) from the hips' frame; lengths of thigh and shank (2,), and height of the ankle."""
View = tuple[Floats, tuple[float, float, float, float]]
"""The rotation (3, 3) from reference to optical frame, focal lengths and principal point, px."""
Prior = tuple[Floats, Floats, Floats, Floats]
"""Angles of the image before (8,) and deviations of their change; what images share (4,), and the
lower root (4, 4) of its information."""
Shown = tuple[Floats, Floats, Floats, Floats, tuple[float, float]]
"""Knees and ankles in the image (2, 2, 2), their deviations (2, 2), px, inf for unknown ones;
slopes of thighs and shanks (2, 2), nan for unknown ones, and their deviations (2, 2); how much
nearer to the camera than the hips the shoulders are, m, and the deviation of the
middle of the whole mass from that of somebody who stands, m, inf for who does not."""
Given = tuple[Person, View, Prior, Shown]


@inlined_kernel
def _place(values: Floats, of: Person, points_m: Floats) -> None:
    """Write hips, knees and ankles of both legs, (6, 3), reference frame."""
    hip_m, aside, turn, lengths_m, _ = of
    scale = exp(values[DISTANCE])
    for leg in range(2):
        side, at = 1.0 - 2.0 * leg, 4 * leg
        cf, sf = cos(values[at]), sin(values[at])
        ca, sa = cos(values[at + 1]), sin(values[at + 1])
        cr, sr = cos(values[at + 2]), sin(values[at + 2])
        cb, sb = cos(values[at + 3]), sin(values[at + 3])
        # The shank turns about the thigh's axis, then outwards, then forwards.
        x, y, z = sb * cr, sb * sr * ca + cb * sa, cb * ca - sb * sr * sa
        bones = (sf * ca, side * sa, -cf * ca), (sf * z - cf * x, side * y, -sf * x - cf * z)
        for c in range(3):
            points_m[3 * leg, c] = scale * hip_m[c] + side * aside[c]
        for part in range(2):
            x, y, z = bones[part]
            length_m = lengths_m[part] * exp(values[LENGTHS + part])
            for c in range(3):
                along = turn[c, 0] * x + turn[c, 1] * y + turn[c, 2] * z
                points_m[3 * leg + part + 1, c] = points_m[3 * leg + part, c] + length_m * along


@kernel
def points_of(values: Floats, of: Person) -> Floats:
    """Return hips, knees and ankles (n, 6, 3) of values (n, 12), reference frame."""
    points_m = np.empty((values.shape[0], 6, 3))
    for row in range(values.shape[0]):
        _place(values[row], of, points_m[row])
    return points_m


@kernel
def _middle_m(hip: float, knee: float, ankle: float, trunk_m: float) -> float:
    """Return how far the middle of the mass is ahead of an ankle, m, by coordinates along a line.

    ``trunk_m`` is how far the shoulders are ahead of the hip.
    """
    middle_m = _OF_SHOULDERS * (hip + trunk_m) + _OF_HIPS * hip + _OF_KNEES * knee
    return middle_m + (_OF_ANKLES - 1.0) * ankle


def balanced_m(points_m: Floats, facing: Floats) -> float:
    """Return how far the shoulders of who stands are ahead of the hips, m.

    ``points_m`` (6, 3) are hips, knees and ankles, and ``facing`` (3,) is where the person faces.
    """
    hip, knee, ankle = (np.mean(points_m.reshape(2, 3, 3), axis=0) @ facing).tolist()
    return (_AHEAD_M - _middle_m(hip, knee, ankle, 0.0)) / _OF_SHOULDERS


@borrowing_kernel
def _write_residuals(values: Floats, given: Given, points_m: Floats, residuals: Floats) -> float:
    """Write the residuals (35,) of values (12,), and return the sum of their squares."""
    of, (axes, (fx, fy, cx, cy)), (before, change, expected, root), shown = given
    px, sigma_px, slopes, sigma_slopes, (trunk_m, sigma_m) = shown
    _place(values, of, points_m)
    for leg in range(2):
        at = _OF_LEG * leg
        for part in range(2):
            start, end = points_m[3 * leg + part], points_m[3 * leg + part + 1]
            x, y, z, along, length2 = 0.0, 0.0, 0.0, 0.0, 0.0
            for c in range(3):
                x += axes[0, c] * end[c]
                y += axes[1, c] * end[c]
                z += axes[2, c] * end[c]
                along += axes[2, c] * (end[c] - start[c])
                length2 += (end[c] - start[c]) ** 2
            z, sigma = max(z, NEAREST_M), sigma_px[leg, part]
            residuals[at + 3 * part] = (fx * x / z + cx - px[leg, part, 0]) / sigma
            residuals[at + 3 * part + 1] = (fy * y / z + cy - px[leg, part, 1]) / sigma
            slope = (along / sqrt(length2) - slopes[leg, part]) / sigma_slopes[leg, part]
            residuals[at + 3 * part + 2] = 0.0 if isnan(slope) else slope
        # A foot may not be below the floor; from some height on, it is lifted.
        height_m = points_m[3 * leg + 2, 2] - values[FLOOR] - of[4]
        lifted = max(height_m / _LIFTED_M, 0.0)
        residuals[at + 6] = height_m / sqrt(1.0 + lifted**2) / _CONTACT_M
    at = 2 * _OF_LEG
    for j in range(N_ANGLES):
        residuals[at + j] = values[j] / REST[j]
        residuals[at + N_ANGLES + j] = (values[j] - before[j]) / change[j]
    at += 2 * N_ANGLES
    for i in range(4):
        residuals[at + i] = 0.0
        for j in range(i, 4):
            residuals[at + i] += root[j, i] * (values[LENGTHS + j] - expected[j])
    # Along the line of sight, which the image shows poorly.
    middle_m = 0.0
    for leg in range(2):
        hip, knee, ankle = points_m[3 * leg, 0], points_m[3 * leg + 1, 0], points_m[3 * leg + 2, 0]
        middle_m += _middle_m(hip, knee, ankle, trunk_m)
    residuals[at + 4] = (middle_m / 2 - _AHEAD_M * of[2][0, 0]) / sigma_m
    total = 0.0
    for i in range(_N_RESIDUALS):
        total += residuals[i] ** 2
    return total


@borrowing_kernel
def _write(values: Floats, given: tuple[Given, Floats], residuals: Floats) -> None:
    _write_residuals(values, given[0], given[1], residuals)


@kernel
def _solve(first: Floats, others: Floats, given: Given) -> Equations:
    """Return the equations of the best values from the first and from the best other start."""
    points_m, residuals, least = np.empty((6, 3)), np.empty(_N_RESIDUALS), inf
    start = np.empty((2 if others.shape[0] else 1, N_VALUES))
    start[0] = first
    for row in range(others.shape[0]):
        cost = _write_residuals(others[row], given, points_m, residuals)
        if cost < least:
            least = cost
            start[1] = others[row]
    rows = (given, points_m), _N_RESIDUALS, DIFFERENCE
    return minimize_compiled(_write, rows, start, _RULES, ENDS)


def fit(first: Floats, others: Floats, given: Given) -> tuple[Floats, Floats, float]:
    """Return the best values (12,), their information (12, 12), and the residuals' sum of squares.

    The fit begins at ``first`` (12,) and at the best of the ``others`` (n, 12).
    """
    found = Solution(_solve(first, others, given), ["legs"])
    best = int(np.argmin(found.total))
    return found.values[best], found.information[best], float(found.total[best])
