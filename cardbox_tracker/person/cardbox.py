"""The 3D cardbox model: 15 planar patches (paper, section II-A).

Head, waist, and each upper arm and forearm are two perpendicular patches through the part's axis,
one frontal (in the plane of Y and Z) and one sagittal (X and Z). The torso has three: a frontal
trapezoid, a sagittal rectangle, and a horizontal one at its top.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.person.kinematics import PosedBodies, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import Part, parts_of_bodies
from cardbox_tracker.person.sizes import FloatArray

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


class PartPatches(NamedTuple):
    """Corners, metres, in order around each patch, in the frame of its part, see ``parts.py``."""

    trunk: FloatArray
    """Shape (..., 7, 4, 3): torso, waist and head, in the torso's frame."""
    upper_arm: FloatArray
    """Shape (..., 2, 4, 3), below the shoulder joint."""
    forearm: FloatArray
    """Shape (..., 2, 4, 3), below the elbow joint."""


def part_patches(sizes_m: FloatArray) -> PartPatches:
    """Return the patches of bodies with sizes (..., 18) in the frames of their parts."""
    parts = parts_of_bodies(sizes_m)
    trunk = [_frontal(parts.torso), _sagittal(parts.torso), _lid(parts.torso)]
    for part in (parts.waist, parts.head):
        trunk += [_frontal(part), _sagittal(part)]
    upper_arm, forearm = (
        np.stack([_frontal(part), _sagittal(part)], axis=-3)
        for part in (parts.upper_arm, parts.forearm)
    )
    return PartPatches(np.stack(trunk, axis=-3), upper_arm, forearm)


def cardbox_patches(body: BodyModel, postures: FloatArray) -> FloatArray:
    """Return the corners of the 15 patches in postures (..., 12), rad and metres: (..., 15, 4, 3).

    Shoulders are rigid as in the paper. Corners are metres in the reference frame, in order around
    the patch, the patches ordered as ``PATCH_NAMES``.
    """
    return patches_at(body, pose(body.rigid, postures))


def patches_at(body: BodyModel, frames: PosedBodies) -> FloatArray:
    """Return the corners of the patches of a posed body, as :func:`cardbox_patches`."""
    patches = part_patches(body.sizes)
    return np.concatenate(
        [
            _place(patches.trunk, frames.torso_rotation, frames.hip),
            _place(patches.upper_arm, frames.left.upper_arm_rotation, frames.left.shoulder),
            _place(patches.forearm, frames.left.forearm_rotation, frames.left.elbow),
            _place(patches.upper_arm, frames.right.upper_arm_rotation, frames.right.shoulder),
            _place(patches.forearm, frames.right.forearm_rotation, frames.right.elbow),
        ],
        axis=-3,
    )


def _frontal(part: Part[FloatArray]) -> FloatArray:
    """Return a trapezoid (..., 4, 3) in the plane of Y and Z through the part's axis."""
    below, above = part.bottom_width_m / 2, part.top_width_m / 2
    return _quadrilateral(
        [part.forward_m] * 4,
        [-below, below, above, -above],
        [part.bottom_m, part.bottom_m, part.top_m, part.top_m],
    )


def _sagittal(part: Part[FloatArray]) -> FloatArray:
    """Return a rectangle (..., 4, 3) in the plane of X and Z."""
    half, forward = part.depth_m / 2, part.forward_m
    return _quadrilateral(
        [-half + forward, half + forward, half + forward, -half + forward],
        [0.0 * half] * 4,
        [part.bottom_m, part.bottom_m, part.top_m, part.top_m],
    )


def _lid(part: Part[FloatArray]) -> FloatArray:
    """Return a horizontal rectangle (..., 4, 3) at the part's top."""
    x, y = part.depth_m / 2, part.top_width_m / 2
    return _quadrilateral([-x, x, x, -x], [-y, -y, y, y], [part.top_m] * 4)


def _quadrilateral(x: list[FloatArray], y: list[FloatArray], z: list[FloatArray]) -> FloatArray:
    """Return corners (..., 4, 3) from four coordinates (...) each."""
    return np.stack([np.stack(axis, axis=-1) for axis in (x, y, z)], axis=-1)


def _place(corners: FloatArray, rotation: FloatArray, origin: FloatArray) -> FloatArray:
    """Rotate ``corners`` (k, 4, 3) by ``rotation`` (..., 3, 3) and add ``origin`` (..., 3)."""
    placed: FloatArray = np.einsum("...ij,kcj->...kci", rotation, corners)
    return placed + origin[..., None, None, :]
