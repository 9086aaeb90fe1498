"""The 3D volumetric model of the paper's comparison: each part a box of six faces.

The boxes span the same sizes as the cardbox patches, so both models cover the same person; the
volumetric one has 6 x 7 = 42 planes to draw where the cardbox has 15.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray

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

# Corners of a box: 0-3 around its bottom, 4-7 around its top, in the same order.
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
    frames = forward_kinematics(body, postures)
    size = body.size
    waist_m, top_m = size("waist_height"), size("waist_height") + size("torso_height")
    chin_m = top_m + size("neck_length")
    depth = size("torso_depth")
    torso = _box(depth, depth, size("torso_bottom_width"), size("torso_top_width"), waist_m, top_m)
    waist = _prism(size("waist_depth"), size("waist_width"), 0.0, waist_m)
    head = _prism(size("head_depth"), size("head_width"), chin_m, chin_m + size("head_height"))
    head[:, 0] += size("head_offset")
    upper_arm = _prism(
        size("upper_arm_width"), size("upper_arm_width"), -size("upper_arm_length"), 0.0
    )
    forearm = _prism(size("forearm_width"), size("forearm_width"), -size("forearm_length"), 0.0)

    placed = [(box, frames.torso_rotation, frames.hip) for box in (torso, waist, head)]
    for arm in (frames.left, frames.right):
        placed.append((upper_arm, arm.upper_arm_rotation, arm.shoulder))
        placed.append((forearm, arm.forearm_rotation, arm.elbow))
    return np.concatenate(
        [
            np.einsum("...ij,fcj->...fci", rotation, box[_FACES]) + origin[..., None, None, :]
            for box, rotation, origin in placed
        ],
        axis=-3,
    )


def _box(
    bottom_depth_m: float,
    top_depth_m: float,
    bottom_width_m: float,
    top_width_m: float,
    bottom_m: float,
    top_m: float,
) -> FloatArray:
    """Corners (8, 3) of a frustum around the Z axis."""
    corners = []
    for depth_m, width_m, z_m in (
        (bottom_depth_m, bottom_width_m, bottom_m),
        (top_depth_m, top_width_m, top_m),
    ):
        x, y = depth_m / 2, width_m / 2
        corners += [(-x, -y, z_m), (x, -y, z_m), (x, y, z_m), (-x, y, z_m)]
    return np.array(corners)


def _prism(depth_m: float, width_m: float, bottom_m: float, top_m: float) -> FloatArray:
    return _box(depth_m, depth_m, width_m, width_m, bottom_m, top_m)
