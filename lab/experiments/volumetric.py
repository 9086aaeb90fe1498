"""Volumetric model of the paper's comparison: each part is a box with six faces.

The boxes span the same sizes as the cardbox patches, so both models cover the same person; the
volumetric one has 6 x 7 = 42 planes to draw where the cardbox has 15.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import Part, body_parts
from cardbox_tracker.person.sizes import FloatArray

PART_NAMES: tuple[str, ...] = (
    "torso",
    "waist",
    "head",
    "left_upper_arm",
    "left_forearm",
    "right_upper_arm",
    "right_forearm",
)
N_FACES = 6 * len(PART_NAMES)
TRUNK_FACES = slice(0, 18)
LEFT_ARM_FACES = slice(18, 30)
RIGHT_ARM_FACES = slice(30, 42)

# Faces by corners of a box: 0-3 around its bottom, 4-7 around its top, in the same order.
_FACES = np.array(
    [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
)


def volumetric_faces(body: BodyModel, postures: FloatArray) -> FloatArray:
    """Return the corners of the 42 faces in each posture.

    Args:
        body: the measured person.
        postures: shape (..., 12), rad and metres.

    Returns:
        Shape (..., 42, 4, 3), metres in the reference frame, six faces a part, the parts ordered as
        ``PART_NAMES``.
    """
    frames = pose(body.rigid, postures)
    parts = body_parts(body.sizes)
    placed = [
        (_box(part), frames.torso_rotation, frames.hip)
        for part in (parts.torso, parts.waist, parts.head)
    ]
    for arm in (frames.left, frames.right):
        placed.append((_box(parts.upper_arm), arm.upper_arm_rotation, arm.shoulder))
        placed.append((_box(parts.forearm), arm.forearm_rotation, arm.elbow))
    return np.concatenate(
        [
            np.einsum("...ij,fcj->...fci", rotation, box[_FACES]) + origin[..., None, None, :]
            for box, rotation, origin in placed
        ],
        axis=-3,
    )


def _box(part: Part[float]) -> FloatArray:
    """Return the corners (8, 3) of a part in its frame."""
    corners = []
    x, forward = part.depth_m / 2, part.forward_m
    for width_m, z in ((part.bottom_width_m, part.bottom_m), (part.top_width_m, part.top_m)):
        y = width_m / 2
        corners += [(-x + forward, -y, z), (x + forward, -y, z)]
        corners += [(x + forward, y, z), (-x + forward, y, z)]
    return np.array(corners)
