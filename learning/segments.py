"""The segments of a body, which every rig and every motion of this folder shares.

Axes of bodies and of the world, metres: x forward out of the chest, y to the person's left, z up;
the floor is z = 0. In the T-pose a person stands upright and faces +x: arms straight out along
+-y, palms down, legs straight down, feet forward.

A *pose* is ``(turns, place)``: ``turns`` (segments, 3, 3) are world rotations of each segment
against its orientation in the T-pose, in the order of :data:`SEGMENTS`; ``place`` (3,) is the
middle of the two hip joints of a person whose hip joints stand 1 m above the floor.
"""

from __future__ import annotations

SEGMENTS = (
    "hips",
    "spine",
    "chest",
    "neck",
    "head",
    "left_collar",
    "left_upper_arm",
    "left_forearm",
    "left_hand",
    "left_thigh",
    "left_shin",
    "left_foot",
    "right_collar",
    "right_upper_arm",
    "right_forearm",
    "right_hand",
    "right_thigh",
    "right_shin",
    "right_foot",
)
"""Names of the segments, parents before their children."""

PARENTS = (-1, 0, 1, 2, 3, 2, 5, 6, 7, 0, 9, 10, 2, 12, 13, 14, 0, 16, 17)
"""Index of each segment's parent in :data:`SEGMENTS`; -1 for the hips."""
