"""Compiled proposals of arms, from the arms that fitted so far and from a bank.

Callers pass the random numbers, unit normal or uniform in 0..1.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import (
    angles_in,
    first_angle,
    pose_arm,
    side_of,
    state_pose,
)
from cardbox_tracker.person.posture import ARM_ANGLES
from cardbox_tracker.search.joint_moves import Numbers
from cardbox_tracker.search.mirroring import mirror
from cardbox_tracker.search.state_choice import least_of
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

ArmPlan = tuple[int, float, int, int, Floats, Floats]
"""Numbers of states whose arms are varied, and noise of these, rad; numbers of arms mirrored in
depth, and of those from a bank; the bank's samples of the prior, (K, 4), rad; lowest and highest
angles, (4, 2), rad."""


@kernel
def propose_arms(
    pool: Floats,
    arm: int,
    plan: ArmPlan,
    body: BodyTuple,
    numbers: Numbers,
) -> Floats:
    """Return arms (N, 4), 0 left or 1 right, for the torso of the first state of ``pool`` (M, 14).

    The first arm is that of the first state; then follow varied arms of the best states. The last
    arms are, from the end: arms of the first four states mirrored in depth; arms from the bank.
    ``numbers`` are (N, 4) and (N, 1), ``body`` the fields of
    :class:`~cardbox_tracker.terms.kernel_arguments.Body`.
    """
    sources, sigma_rad, mirrors, banked, bank, arm_limits = plan
    normals, uniforms = numbers
    of = body_of(body)
    parts = of.parts
    n = normals.shape[0]
    first, side = first_angle(arm), side_of(arm)
    arms = np.empty((n, ARM_ANGLES))
    rotation, hip = np.empty((3, 3)), np.empty(3)
    points, directions = np.empty((3, 3)), np.empty(6)
    shoulder, sight = np.empty(3), np.empty(3)
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
