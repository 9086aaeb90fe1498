"""What the markers of a posture look like; the same live and in a recording, without rclpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.vision.camera import Camera

Rgba = tuple[float, float, float, float]

SKELETON_WIDTH_M = 0.02
SKELETON_RGBA: Rgba = (1.0, 1.0, 1.0, 1.0)
TORSO_RGBA: Rgba = (0.25, 0.45, 0.75, 0.7)
_SIDES: dict[str, Rgba] = {"left": (0.2, 0.7, 0.4, 0.7), "right": (0.85, 0.45, 0.2, 0.7)}
PART_RGBA: tuple[Rgba, ...] = (TORSO_RGBA, *_SIDES.values())
_TRIANGLES = (0, 1, 2, 0, 2, 3)


class MarkerShapes(NamedTuple):
    """Two triangles per patch, and one line per bone.

    Attributes:
        triangles_m: (90, 3), three corners per triangle, metres in the optical frame.
        colors: colour of each corner, 90 of them.
        bones_m: (16, 3), both ends of each bone.
    """

    triangles_m: FloatArray
    colors: list[Rgba]
    bones_m: FloatArray


def marker_shapes(body: BodyModel, camera: Camera, posture: FloatArray) -> MarkerShapes:
    """Return the shapes of ``body`` in a posture (12,) before ``camera``."""
    patches = camera.reference_to_optical(cardbox_patches(body, posture))
    colors = [
        color
        for name in PATCH_NAMES
        for color in [_SIDES.get(name.split("_")[0], TORSO_RGBA)] * len(_TRIANGLES)
    ]
    frames = forward_kinematics(body, posture)
    bones = [(frames.hip, frames.neck), (frames.neck, frames.head)]
    for arm in (frames.left, frames.right):
        bones += [(frames.neck, arm.shoulder), (arm.shoulder, arm.elbow), (arm.elbow, arm.hand)]
    return MarkerShapes(
        patches[:, _TRIANGLES].reshape(-1, 3),
        colors,
        camera.reference_to_optical(np.array(bones)).reshape(-1, 3),
    )
