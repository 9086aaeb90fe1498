"""Compiled proposals of arms, from the arms that fitted so far and from the silhouette.

Callers pass the random numbers, unit normal or uniform in 0..1.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    angles_of_arm,
    first_angle,
    pose_arm,
    side_of,
    state_pose,
)
from cardbox_tracker.person.parts import FOREARM, HEIGHT, UPPER_ARM
from cardbox_tracker.person.posture import ARM_ANGLES
from cardbox_tracker.search.joint_moves import Numbers
from cardbox_tracker.search.mirroring import mirror
from cardbox_tracker.search.state_choice import least_of
from cardbox_tracker.terms.bit_planes import FOREGROUND, PIXELS, Planes, value_at
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

# Margins of the distance from shoulder to hand of an arm that reaches for a pixel, against the
# difference and the sum of the bones' lengths, m.
_FOLDED_M, _STRETCHED_M = 0.05, 0.001
# Probability of the nearer one of two points: people gesture to the front.
_NEARER = 0.8
# Direction (forwards, outwards, up) of an elbow that hangs down.
_ELBOW_HANGS = (-0.2, 0.4, -1.0)
_ELBOW_TURNS_RAD = 1.2 * pi
# Search of the tip of an arm: radius in arm lengths from the shoulder; least number of uncovered
# points.
_REACH, _FEWEST_TIPS = 1.1, 3
_INWARDS_PX = 3.0
# Distance between the points of the grid that is searched for it, px.
_GRID_PX = 3

ArmPlan = tuple[int, float, int, int, int, Floats, Floats]
"""Numbers of states whose arms are varied, and noise of these, rad; numbers of arms mirrored in
depth, of those that reach for uncovered foreground, and of those from a bank; the bank's samples of
the prior, (K, 4), rad; lowest and highest angles, (4, 2), rad."""


class Ray(NamedTuple):
    """A line of sight to a hand, and the arm's shoulder."""

    shoulder: Floats  #: in the optical frame, (3,), metres
    direction: Floats  #: unit vector, (3,)
    rotation: Floats  #: rotation of the torso, (3, 3)


@inlined_kernel
def _reach(
    angles: Floats,
    side: float,
    towards: Ray,
    parts: Floats,
    uniforms: Floats,
    arm_limits: Floats,
    directions: Floats,
) -> None:
    """Write the angles (4,) of an arm whose hand is on a ray, by two-bone inverse kinematics.

    The first of ``uniforms`` (3,) determines the distance r from the shoulder to the hand between
    the least possible distance and the straight arm; the second selects one of the two points of
    the ray at this distance. With bones a and b, the elbow lies on a circle around the line from
    shoulder to hand, at cos = (a^2 + r^2 - b^2) / (2 a r) from it; the third determines its place
    on the circle.
    """
    shoulder, ray, rotation = towards
    stretch, which, turn = uniforms[0], uniforms[1], uniforms[2]
    a, b = parts[UPPER_ARM, HEIGHT], parts[FOREARM, HEIGHT]
    along = shoulder[0] * ray[0] + shoulder[1] * ray[1] + shoulder[2] * ray[2]
    # Vector from the shoulder to its nearest point of the ray.
    squares = 0.0
    for j in range(3):
        squares += (along * ray[j] - shoulder[j]) ** 2
    near = sqrt(squares)
    farthest = a + b - _STRETCHED_M
    low = min(max(near, abs(a - b) + _FOLDED_M), farthest)
    reach = low + (farthest - low) * stretch
    step = sqrt(max(reach * reach - near * near, 0.0))
    if which < _NEARER:
        step = -step
    ux, uy, uz = 0.0, 0.0, 0.0
    length = 1e-12
    for j in range(3):
        hand = (along + step) * ray[j] - shoulder[j]
        ux += rotation[j, 0] * hand
        uy += rotation[j, 1] * hand
        uz += rotation[j, 2] * hand
        length += hand * hand
    length = sqrt(length)
    ux, uy, uz = ux / length, uy / length, uz / length
    cosine = min(max((a * a + reach * reach - b * b) / (2.0 * a * reach), -1.0), 1.0)
    sine = sqrt(1.0 - cosine * cosine)
    # v and w span the plane of the elbow's circle; v points to a hanging elbow.
    vx, vy, vz = _ELBOW_HANGS[0], _ELBOW_HANGS[1] * side, _ELBOW_HANGS[2]
    dot = ux * vx + uy * vy + uz * vz
    vx, vy, vz = vx - dot * ux, vy - dot * uy, vz - dot * uz
    norm = sqrt(vx * vx + vy * vy + vz * vz) + 1e-9
    vx, vy, vz = vx / norm, vy / norm, vz / norm
    wx, wy, wz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    angle = (turn - 0.5) * _ELBOW_TURNS_RAD
    ct, st = sine * cos(angle), sine * sin(angle)
    directions[0] = cosine * ux + ct * vx + st * wx
    directions[1] = cosine * uy + ct * vy + st * wy
    directions[2] = cosine * uz + ct * vz + st * wz
    directions[3] = (reach * ux - a * directions[0]) / b
    directions[4] = (reach * uy - a * directions[1]) / b
    directions[5] = (reach * uz - a * directions[2]) / b
    norm = sqrt(directions[3] ** 2 + directions[4] ** 2 + directions[5] ** 2) + 1e-9
    for c in range(3, 6):
        directions[c] /= norm
    angles_of_arm(directions, side, arm_limits, angles)


@inlined_kernel
def _is_inside(uncovered: Planes, row: int, column: int, step: int) -> bool:
    """Return whether a point of the grid counts, see :func:`farthest_uncovered`."""
    if value_at(uncovered, row, column) != -1:
        return False
    level = 0
    for beside in range(column - 2, column + 3):
        level += value_at(uncovered, row, beside)
    if level > -4:
        return False
    above, below = row - step, row + step
    return value_at(uncovered, above, column) == -1 or value_at(uncovered, below, column) == -1


@kernel
def farthest_uncovered(
    uncovered: Planes, size: tuple[int, int], u: float, v: float, reach_px: float
) -> tuple[int, float, float]:
    """Return how many uncovered points are near a pixel, and column and row of the farthest one.

    A point of the grid counts if it is foreground, the values 1 - 2 f of the five pixels around it
    in its row add up to at most -4, and the point above or below is foreground. ``uncovered`` are
    planes (2, words, rows or more) without the covered pixels, of which ``size`` count, rows and
    width; ``u``, ``v`` and the largest distance are px.
    """
    rows, width = size
    count, best = 0, -1.0
    tip_u, tip_v = 0.0, 0.0
    step = _GRID_PX
    left, right = max(int(u - reach_px), step), min(int(u + reach_px), width - step - 1)
    top, bottom = max(int(v - reach_px), step), min(int(v + reach_px), rows - step - 1)
    for row in range(top, bottom, step):
        for w in range(left // PIXELS, (right + PIXELS - 1) // PIXELS):
            # Most words have no uncovered foreground.
            if uncovered[FOREGROUND, w, row] == 0:
                continue
            begin = left + max(PIXELS * w - left + step - 1, 0) // step * step
            for column in range(begin, min(PIXELS * (w + 1), right), step):
                far = (column - u) ** 2 + (row - v) ** 2
                if far <= reach_px * reach_px and _is_inside(uncovered, row, column, step):
                    count += 1
                    if far > best:
                        best, tip_u, tip_v = far, float(column), float(row)
    return count, tip_u, tip_v


@kernel
def propose_arms(
    pool: Floats,
    arm: int,
    plan: ArmPlan,
    uncovered: Planes,
    size: tuple[int, int],
    body: BodyTuple,
    numbers: Numbers,
) -> Floats:
    """Return arms (N, 4), 0 left or 1 right, for the torso of the first state of ``pool`` (M, 14).

    The first arm is that of the first state; then follow varied arms of the best states. The last
    arms are, from the end: arms of the first four states mirrored in depth; arms that reach for the
    end of the uncovered foreground, if there is any; arms from the bank. ``numbers`` are (N, 4) and
    (N, 3), ``body`` the fields of :class:`~cardbox_tracker.terms.kernel_arguments.Body`;
    ``uncovered`` are planes outside of trunk and other arm, (2, words, rows or more), and ``size``
    the rows that count, and the width, px.
    """
    sources, sigma_rad, mirrors, tips, banked, bank, arm_limits = plan
    normals, uniforms = numbers
    of = body_of(body)
    parts = of.parts
    n = normals.shape[0]
    first, side = first_angle(arm), side_of(arm)
    arms = np.empty((n, ARM_ANGLES))
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, directions = np.empty((3, 3)), np.empty(6)
    shoulder, ray, sight = np.empty(3), np.empty(3), np.empty(3)
    torso = pool[0]
    state_pose(torso, of.place, of.camera, rotation, hip)
    pose_arm(angles_in(torso, arm), side, parts, of.girdle, points, directions)
    norm = 0.0
    for j in range(3):
        shoulder[j] = hip[j]
        for c in range(3):
            shoulder[j] += rotation[j, c] * points[0, c]
        norm += shoulder[j] ** 2
    for c in range(3):
        sight[c] = 0.0
        for j in range(3):
            sight[c] += rotation[j, c] * shoulder[j] / sqrt(norm)
    around = min(sources, pool.shape[0])
    for i in range(n):
        source = pool[i % around]
        for d in range(ARM_ANGLES):
            moved = source[first + d] + (sigma_rad * normals[i, d] if i > 0 else 0.0)
            arms[i, d] = min(max(moved, arm_limits[d, 0]), arm_limits[d, 1])
    end = n - mirrors
    for i in range(mirrors):
        angles = arms[end + i]
        source = pool[i % min(4, pool.shape[0])]
        for d in range(ARM_ANGLES):
            angles[d] = source[first + d]
        flips = 1 + int(3.0 * uniforms[end + i, 0])
        mirror(angles, side, flips, sight, arm_limits, directions)
    fx, fy, cx, cy = of.camera.fx, of.camera.fy, of.camera.cx, of.camera.cy
    u, v = fx * shoulder[0] / shoulder[2] + cx, fy * shoulder[1] / shoulder[2] + cy
    length_px = (parts[UPPER_ARM, HEIGHT] + parts[FOREARM, HEIGHT]) * fx / shoulder[2]
    count, tip_u, tip_v = farthest_uncovered(uncovered, size, u, v, _REACH * length_px)
    if count >= _FEWEST_TIPS:
        # The keypoint of the hand lies before the end of the outline.
        far = sqrt((u - tip_u) ** 2 + (v - tip_v) ** 2) + 1e-9
        inwards = min(_INWARDS_PX / far, 1.0)
        tip_u, tip_v = tip_u + inwards * (u - tip_u), tip_v + inwards * (v - tip_v)
        ray[0], ray[1], ray[2] = (tip_u - cx) / fx, (tip_v - cy) / fy, 1.0
        norm = sqrt(ray[0] ** 2 + ray[1] ** 2 + 1.0)
        for c in range(3):
            ray[c] /= norm
        end -= tips
        for i in range(end, end + tips):
            towards = Ray(shoulder, ray, rotation)
            _reach(arms[i], side, towards, parts, uniforms[i], arm_limits, directions)
    for i in range(end - banked, end):
        chosen = int(uniforms[i, 0] * bank.shape[0])
        for d in range(ARM_ANGLES):
            arms[i, d] = bank[chosen, d]
    return arms


@kernel
def around_best(
    arms: Floats, ratings: Floats, count: int, sigma_rad: float, arm_limits: Floats, normals: Floats
) -> Floats:
    """Return arms (N, 4) around the best ``count`` of ``arms`` (M, 4); ``normals`` are (N, 4)."""
    order = least_of(ratings, count)
    moved = np.empty_like(normals)
    for i in range(normals.shape[0]):
        source = arms[order[i % count]]
        for d in range(ARM_ANGLES):
            value = source[d] + sigma_rad * normals[i, d]
            moved[i, d] = min(max(value, arm_limits[d, 0]), arm_limits[d, 1])
    return moved


@kernel
def best_of_each(arms: Floats, costs: Floats, candidates: int) -> Floats:
    """Return the arm with the least of ``costs`` (N,) of each ``candidates`` arms (N, 4)."""
    best = np.empty((arms.shape[0] // candidates, ARM_ANGLES))
    for i in range(best.shape[0]):
        least = i * candidates
        for j in range(least + 1, (i + 1) * candidates):
            if costs[j] < costs[least]:
                least = j
        for d in range(ARM_ANGLES):
            best[i, d] = arms[least, d]
    return best
