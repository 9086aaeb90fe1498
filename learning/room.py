"""Random cameras, walls and light of simulated recordings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.camera import Camera
from learning.rendering import Rendering

FloatArray = NDArray[np.float64]

_WIDTH, _HEIGHT = 320, 240
# Height of the middle of the upper body, as a share of the stature.
_MIDDLE = 0.68


@dataclass(frozen=True)
class Viewpoint:
    """Place of a camera.

    Attributes:
        camera: at the working resolution.
        place_m: optical centre (3,) in the world; the camera looks along -x.
    """

    camera: Camera
    place_m: FloatArray

    def optical(self, world_m: NDArray[np.floating[Any]]) -> FloatArray:
        """Return points (..., 3) of the world in the optical frame, metres."""
        return self.camera.reference_to_optical(np.asarray(world_m, np.float64) - self.place_m)


def draw_viewpoint(rng: np.random.Generator, stature_m: float) -> Viewpoint:
    """Draw a camera that sees the upper body of a person who stands at the origin.

    Distance, height, pitch and field of view vary; the raised arms mostly remain in the image.
    """
    width, height = (_WIDTH, _HEIGHT) if rng.random() < 0.8 else (_HEIGHT, _WIDTH)
    fov_rad = np.radians(rng.uniform(38.0, 80.0))
    focal = width / 2.0 / np.tan(fov_rad / 2.0)
    # Heights of the image at the person, from the upper body alone to a person far away.
    shown_m = stature_m * rng.uniform(0.85, 1.6) * (1.0 if width > height else 1.4)
    distance_m = float(np.clip(focal * shown_m / height, 1.0, 5.0))
    level_m = rng.choice([rng.uniform(0.6, 1.6), rng.uniform(1.2, 2.4)])
    down = np.arctan2(level_m - _MIDDLE * stature_m, distance_m)
    pitch_rad = float(np.clip(down + rng.normal(0.0, np.radians(3.0)), -0.5, 0.7))
    camera = Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, pitch_rad)
    sideways_m = rng.normal(0.0, 0.05) * distance_m
    return Viewpoint(camera, np.array([distance_m, sideways_m, level_m]))


class Room:
    """Wall, light and sensor of one recording."""

    def __init__(self, camera: Camera, rng: np.random.Generator) -> None:
        """Draw them; all noise comes from ``rng``."""
        self._rng = rng
        shape = camera.height, camera.width
        coarse = rng.normal(0.0, 1.0, (shape[0] // 24 + 2, shape[1] // 24 + 2, 3))
        size = (camera.width, camera.height)
        blotches = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
        colour = rng.uniform(40.0, 220.0) + rng.normal(0.0, 15.0, 3)
        wall = np.clip(colour + rng.uniform(2.0, 25.0) * blotches, 0.0, 255.0)
        self._gain = rng.uniform(0.7, 1.15, 3).astype(np.float32)
        self._wall = (wall * self._gain).astype(np.float32)
        noise = rng.standard_normal((2 * shape[0], 2 * shape[1], 3), dtype=np.float32)
        self._noise = rng.uniform(1.0, 6.0) * noise
        light = rng.normal((0.0, -1.0, -1.0), 1.0)
        self.light = light / np.linalg.norm(light)

    def image(self, rendering: Rendering) -> NDArray[np.uint8]:
        """Return the image (H, W, 3) bgr of a rendering whose colours are RGB."""
        seen = rendering.silhouette
        clean = self._wall.copy()
        clean[seen] = rendering.colour[seen, ::-1] * self._gain
        height, width = seen.shape
        # A random part of one field of noise is fast, and differs from image to image.
        row, column = self._rng.integers(0, (height, width))
        clean += self._noise[row : row + height, column : column + width]
        return np.asarray(cv2.convertScaleAbs(np.maximum(clean, 0.0)), np.uint8)
