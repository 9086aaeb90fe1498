"""How surely the vertical edges of a room show pitch and roll of a camera that stands still.

The images of upright edges, such as those of doors and corners, meet in the vanishing point of the
vertical. Each line in an image spans a plane with the camera's centre; the plane of an upright edge
contains the vertical. Some of the lines near the vertical are such edges, and the others have any
direction, so each adds the logarithm of a mixture of both to the likelihood of a pitch and a roll.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.sizes import FloatArray

PITCHES_RAD = np.radians(np.arange(-40.0, 51.0))
ROLLS_RAD = np.radians(np.arange(-30.0, 31.0))

# Lines that count: their angle from the image's columns, rad; their least length and their least
# distance from the left and right border, as shares of the longer side. Encoders and black bars
# make lines along the border.
_STEEPEST, _SHORTEST, _BORDER = np.radians(35.0), 0.04, 0.012
# Length of a line that counts as one observation, as a share of the longer side.
_WHOLE = 0.25
# Angle of an edge from the vertical, standard deviation, rad; share of upright edges among lines.
_ANGLE, _SHARE = np.radians(0.8), 0.3
# Longer side of the images in which lines are sought, px.
_LONGER_PX = 960


def edge_likelihoods(
    pictures: Sequence[NDArray[np.uint8]],
    camera: Camera,
    turns: Sequence[FloatArray] | None = None,
) -> FloatArray:
    """Return the logarithm of the likelihood of each pitch and roll, (P, R).

    Pictures (H, W) or (H, W, 3) are of the camera at any resolution, undistorted. It is for
    ``PITCHES_RAD`` and ``ROLLS_RAD``; 0 everywhere without lines. ``turns`` are rotations (3, 3) of
    a camera that turns into its frame at each picture, from the one whose pitch and roll they are.
    """
    pitches, rolls = np.meshgrid(PITCHES_RAD, ROLLS_RAD, indexing="ij")
    down = np.stack(
        [np.cos(pitches) * np.sin(rolls), np.cos(pitches) * np.cos(rolls), np.sin(pitches)], -1
    )
    sums = np.zeros(pitches.shape)
    outlier = 1.0 - _SHARE
    peak = _SHARE * 2 * _STEEPEST / (_ANGLE * np.sqrt(2 * np.pi))
    for number, picture in enumerate(pictures):
        normals, weights = _planes(picture, camera)
        normals = normals if turns is None else normals @ turns[number]
        away = np.arcsin(np.clip(down @ normals.T, -1.0, 1.0))
        sums += np.log(outlier + peak * np.exp(-((away / _ANGLE) ** 2) / 2)) @ weights
    return sums / max(1, len(pictures))


def _planes(picture: NDArray[np.uint8], camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return normals (n, 3) and weights (n,) of the planes of steep lines."""
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    longer = max(grey.shape)
    if longer > _LONGER_PX:
        scale = _LONGER_PX / longer
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        longer = _LONGER_PX
    view = camera.scaled(grey.shape[1], grey.shape[0])
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    ends = np.zeros((0, 2, 2)) if found is None else found.reshape(-1, 2, 2).astype(np.float64)
    along = np.abs(ends[:, 1] - ends[:, 0])
    lengths = np.hypot(*along.T)
    columns, border = ends[..., 0], _BORDER * longer
    is_inside = (columns.max(axis=1) > border) & (columns.min(axis=1) < view.width - 1 - border)
    is_steep = along[:, 0] < np.tan(_STEEPEST) * along[:, 1]
    kept = is_inside & is_steep & (lengths > _SHORTEST * longer)
    rays = view.rays(ends[kept])
    normals = np.cross(rays[:, 0], rays[:, 1])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, lengths[kept] / (_WHOLE * longer)
