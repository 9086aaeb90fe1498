"""Signed distances, which change smoothly, of model's and silhouette's outline on a grid."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import WORKING_SIZE, Camera
from cardbox_tracker.person.posture import ARM_ANGLES
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.distance_field import FAR, padded_width, signed_distances_of
from cardbox_tracker.terms.term import Silhouette

HALF_PX = 5.0
"""Distance with a quarter of the weight."""

# Distance between neighbouring points of the grid, px.
_GRID = 4
# fillConvexPoly paints every pixel that an edge touches.
_TOO_WIDE_PX = 0.5
ABOVE_HIPS_PX = 4
"""Height above the hips at which the legs, which the model lacks, begin."""

STATE_STEP = np.array([0.02, 0.03, 0.03, 0.08, *[0.055] * (2 * ARM_ANGLES), 0.04, 0.02])
"""Steps (14,) of central differences, about 2 px; smaller steps would suffer from whole pixels."""

# Margin around the person for the moved model.
_MARGIN_PX = 24


def comparing(camera: Camera) -> Camera:
    """Return the camera at the size at which outlines are compared."""
    scale = math.sqrt(math.prod(WORKING_SIZE) / (camera.width * camera.height))
    return camera.scaled(round(scale * camera.width), round(scale * camera.height))


class SeenOutline:
    """The part of a silhouette above the hips, and the window of the image around it.

    Attributes:
        is_empty: whether the silhouette has no foreground.
        camera: camera of the window.
        distances: distances of the grid's points from the outline, (n,), px, negative inside.
    """

    def __init__(self, silhouette: Silhouette, camera: Camera, hips_m: FloatArray) -> None:
        """Compute the distances of a silhouette (H, W), 0 or 255, at any size.

        The camera has the size of the comparison, and the middle of the hips (3,) is in its frame.
        """
        size = camera.width, camera.height
        grey = cv2.resize(np.asarray(silhouette, np.uint8), size, interpolation=cv2.INTER_AREA)
        mask = (np.asarray(grey) > 127).astype(np.uint8)
        row = camera.fy * float(hips_m[1]) / max(float(hips_m[2]), 1e-3) + camera.cy
        end = int(np.clip(row - ABOVE_HIPS_PX, 1, camera.height))
        columns, rows = (np.flatnonzero(mask[:end].any(axis=axis)) for axis in (0, 1))
        self.is_empty = columns.size == 0
        left, right, top = 0, camera.width, 0
        if not self.is_empty:
            left = max(0, int(columns[0]) - _MARGIN_PX)
            right = min(camera.width, int(columns[-1]) + _MARGIN_PX)
            top = max(0, int(rows[0]) - _MARGIN_PX)
        # Outlines below the last row still affect the distances above it.
        bottom = min(camera.height, end + FAR)
        self.camera = replace(
            camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top
        )
        self._rows = max(1, end - top)
        self.distances = self._distances(mask[top:bottom, left:right], 0.0)

    def drawn(self, corners_m: FloatArray) -> FloatArray:
        """Return the distances, px, from the outline of patches (n, 4, 3) in the optical frame."""
        image = np.zeros((self.camera.height, self.camera.width), np.uint8)
        for patch in np.rint(16.0 * self.camera.project(corners_m)).astype(np.int32):
            cv2.fillConvexPoly(image, cv2.convexHull(patch), 1, cv2.LINE_8, 4)
        return self._distances(image, _TOO_WIDE_PX)

    def _distances(self, mask: NDArray[np.uint8], too_wide_px: float) -> FloatArray:
        distances = np.empty((len(mask), padded_width(mask.shape[1])), np.float32)
        signed_distances_of(np.ascontiguousarray(mask), distances)
        inside = distances[: self._rows : _GRID, FAR : FAR + mask.shape[1] : _GRID]
        return np.minimum(inside.ravel().astype(np.float64) + too_wide_px, FAR)
