"""The 3D cardbox model: 15 planar patches (paper, section II-A).

Head, waist, and each upper arm and forearm are two perpendicular patches through the part's axis,
one frontal (in the plane of Y and Z) and one sagittal (X and Z). The torso has three: a frontal
trapezoid, a sagittal rectangle, and a horizontal one at its top.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.kinematics import BodyFrames, forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray

PATCH_NAMES: tuple[str, ...] = (
    "torso_frontal",
    "torso_sagittal",
    "torso_top",
    "waist_frontal",
    "waist_sagittal",
    "head_frontal",
    "head_sagittal",
    "left_upper_arm_frontal",
    "left_upper_arm_sagittal",
    "left_forearm_frontal",
    "left_forearm_sagittal",
    "right_upper_arm_frontal",
    "right_upper_arm_sagittal",
    "right_forearm_frontal",
    "right_forearm_sagittal",
)
N_PATCHES = len(PATCH_NAMES)
TORSO_PATCHES = slice(0, 7)
LEFT_ARM_PATCHES = slice(7, 11)
RIGHT_ARM_PATCHES = slice(11, 15)


def cardbox_patches(body: BodyModel, postures: FloatArray) -> FloatArray:
    """Return the corners of the 15 patches in each posture.

    Args:
        body: the measured person.
        postures: shape (..., 12), rad and metres.

    Returns:
        Shape (..., 15, 4, 3), metres in the reference frame; the corners of a patch are in order
        around it, the patches ordered as ``PATCH_NAMES``.
    """
    frames = forward_kinematics(body, postures)
    size = body.size
    waist_m, top_m = size("waist_height"), size("waist_height") + size("torso_height")
    chin_m = top_m + size("neck_length")
    crown_m = chin_m + size("head_height")
    depth = size("torso_depth")
    trunk = np.stack(
        [
            _upright(1, size("torso_bottom_width"), size("torso_top_width"), waist_m, top_m),
            _upright(0, depth, depth, waist_m, top_m),
            _flat(depth, size("torso_top_width"), top_m),
            _upright(1, size("waist_width"), size("waist_width"), 0.0, waist_m),
            _upright(0, size("waist_depth"), size("waist_depth"), 0.0, waist_m),
            _upright(1, size("head_width"), size("head_width"), chin_m, crown_m),
            _upright(0, size("head_depth"), size("head_depth"), chin_m, crown_m),
        ]
    )
    trunk[5:, :, 0] += size("head_offset")
    return np.concatenate(
        [_place(trunk, frames.torso_rotation, frames.hip), *_arm_patches(body, frames)], axis=-3
    )


def _arm_patches(body: BodyModel, frames: BodyFrames) -> list[FloatArray]:
    def limb(length_m: float, width_m: float) -> FloatArray:
        return np.stack([_upright(axis, width_m, width_m, -length_m, 0.0) for axis in (1, 0)])

    upper_arm = limb(body.size("upper_arm_length"), body.size("upper_arm_width"))
    forearm = limb(body.size("forearm_length"), body.size("forearm_width"))
    patches = []
    for arm in (frames.left, frames.right):
        patches.append(_place(upper_arm, arm.upper_arm_rotation, arm.shoulder))
        patches.append(_place(forearm, arm.forearm_rotation, arm.elbow))
    return patches


def _upright(
    axis: int, bottom_width_m: float, top_width_m: float, bottom_m: float, top_m: float
) -> FloatArray:
    """Trapezoid (4, 3) through the Z axis, spreading along X (``axis`` 0) or Y (1)."""
    corners = np.zeros((4, 3))
    corners[:, axis] = (-bottom_width_m / 2, bottom_width_m / 2, top_width_m / 2, -top_width_m / 2)
    corners[:, 2] = (bottom_m, bottom_m, top_m, top_m)
    return corners


def _flat(depth_m: float, width_m: float, height_m: float) -> FloatArray:
    """Horizontal rectangle (4, 3) around the Z axis."""
    x, y = depth_m / 2, width_m / 2
    return np.array([(-x, -y, height_m), (x, -y, height_m), (x, y, height_m), (-x, y, height_m)])


def _place(corners: FloatArray, rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """Turn ``corners`` (k, 4, 3) by ``rotation`` (..., 3, 3), move them to ``origin`` (..., 3)."""
    placed: FloatArray = np.einsum("...ij,kcj->...kci", rotation, corners)
    return placed + origin[..., None, None, :]
