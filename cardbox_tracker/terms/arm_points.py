"""Approximate costs of arms from a few points along their bones, a tenth of the work of drawing.

A limb is a bar, and each point of its axis represents the part of the bar around it. The cost of an
arm is about

    scale * sum over its points of (pixels of that part) * (1 - 2 f)

where 1 - 2 f is -1 if the point's pixel is foreground that trunk and other arm leave uncovered, 0
if it is covered, and 1 if it is background. The approximation selects the arms that are drawn.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import pose_arm, state_pose
from cardbox_tracker.person.parts import HEIGHT, TOP_WIDTH, UPPER_ARM
from cardbox_tracker.terms.bit_planes import Planes, value_at
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Floats, body_of

# Points of the upper arm, including the elbow, and of the forearm, up to the fingertips.
_POINTS = (3, 4)


@kernel
def joints_of_arms(
    arms: Floats, side: float, parts: Floats, girdle: Floats, joints: Floats
) -> None:
    """Write shoulder, elbow and hand of arms (N, 4) to ``joints`` (N, 3, 3), in the torso's frame.

    ``side`` is 1 for the left arm, -1 for the right; angles in rad, joints in metres.
    """
    directions = np.empty(6)
    for i in range(arms.shape[0]):
        pose_arm(arms[i], side, parts, girdle, joints[i], directions)


@kernel
def add_costs_of_arms(
    joints: Floats,
    torso: Floats,
    body: BodyTuple,
    uncovered: Planes,
    size: tuple[int, int],
    scale: float,
    costs: Floats,
) -> None:
    """Add the approximate costs of arms beside the state ``torso`` (14,) to ``costs`` (N,).

    ``joints`` (N, 3, 3) are those of the arms in the torso's frame, metres; ``uncovered`` are
    planes outside of trunk and other arm, (2, words, rows or more), of which ``size`` count, rows
    and width, px; ``scale`` is 1 / (pixels of the silhouette).
    """
    rows, width = size
    of = body_of(body)
    lens, drawn, parts = of.camera, of.drawn, of.parts
    rotation, hip = np.empty((3, 3)), np.empty(3)
    seen_m, axis = np.empty((3, 3)), np.empty(3)
    state_pose(torso, of.place, lens, rotation, hip)
    for i in range(joints.shape[0]):
        for joint in range(3):
            x, y, z = joints[i, joint, 0], joints[i, joint, 1], joints[i, joint, 2]
            for j in range(3):
                turned = rotation[j, 0] * x + rotation[j, 1] * y + rotation[j, 2] * z
                seen_m[joint, j] = hip[j] + turned
        total = 0.0
        for limb in range(2):
            start, part = seen_m[limb], UPPER_ARM + limb
            long_m, wide_m = drawn[part, HEIGHT], drawn[part, TOP_WIDTH]
            for j in range(3):
                axis[j] = (seen_m[limb + 1, j] - start[j]) / parts[part, HEIGHT]
            far_m = max(start[2] + 0.5 * long_m * axis[2], NEAREST_M)
            # Length of the limb in the image: the part of its axis across the line of sight.
            across = axis[0] - axis[2] * start[0] / far_m
            down = axis[1] - axis[2] * start[1] / far_m
            looks_m = sqrt(across * across + down * down) * long_m + 0.5 * wide_m
            part_px = looks_m * wide_m * lens.fx * lens.fy / (far_m * far_m * _POINTS[limb])
            for k in range(_POINTS[limb]):
                along_m = long_m * (k + 1.0) / _POINTS[limb]
                ahead_m = start[2] + along_m * axis[2]
                if ahead_m < NEAREST_M:
                    continue
                column = lens.fx * (start[0] + along_m * axis[0]) / ahead_m + lens.cx + 0.5
                row = lens.fy * (start[1] + along_m * axis[1]) / ahead_m + lens.cy + 0.5
                if 0.0 <= column < width and 0.0 <= row < rows:
                    total += part_px * value_at(uncovered, int(row), int(column))
        costs[i] += scale * total
