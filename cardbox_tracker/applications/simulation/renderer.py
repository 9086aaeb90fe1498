"""Images of a synthetic person in front of a wall, with sensor noise."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.person import person_parts
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import in_front
from cardbox_tracker.person.model import BodyModel

ImageArray = NDArray[np.uint8]

# fillConvexPoly paints every pixel that an edge touches, which widens outlines by up to a subpixel.
_SUPERSAMPLING = 4
_SHIFT = 4
_WALL = 180.0


class Renderer:
    """Renders a person before a wall; all random numbers come from the given generator."""

    def __init__(
        self, camera: Camera, rng: np.random.Generator, texture: float = 8.0, noise: float = 3.0
    ) -> None:
        """Generate the wall; ``texture`` and ``noise`` are standard deviations, grey levels."""
        self.camera = camera
        self._rng, self._noise = rng, noise
        coarse = rng.normal(0.0, 1.0, (camera.height // 20 + 2, camera.width // 20 + 2))
        blotches = cv2.resize(coarse, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)
        self.wall = np.clip(_WALL + texture * blotches, 0, 255).astype(np.float32)

    def silhouette(self, body: BodyModel, posture: NDArray[np.float64]) -> ImageArray:
        """Return the exact silhouette (H, W), 0 or 255, legs included."""
        return np.where(self._draw(body, posture)[1] >= 0.5, 255, 0).astype(np.uint8)

    def image(
        self, body: BodyModel | None = None, posture: NDArray[np.float64] | None = None
    ) -> tuple[ImageArray, ImageArray]:
        """Return a noisy image (H, W) and its silhouette; without a body the empty scene."""
        clean = self.wall
        mask = np.zeros(clean.shape, np.uint8)
        if body is not None and posture is not None:
            person, cover = self._draw(body, posture)
            clean = clean * (1.0 - cover) + person
            mask = np.where(cover >= 0.5, 255, 0).astype(np.uint8)
        # One number is left out, so that a seed gives the same images as in former versions.
        self._rng.standard_normal()
        noise = self._rng.standard_normal(clean.shape, dtype=np.float32) * self._noise
        return np.clip(np.rint(clean + noise), 0, 255).astype(np.uint8), mask

    def _draw(
        self, body: BodyModel, posture: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return brightness times coverage, and coverage in [0, 1], of the person, each (H, W)."""
        camera = self.camera.scaled(
            _SUPERSAMPLING * self.camera.width, _SUPERSAMPLING * self.camera.height
        )
        shade = np.zeros((camera.height, camera.width), np.uint8)
        cover = np.zeros_like(shade)
        # Painter's algorithm: near parts cover far ones.
        parts = sorted(person_parts(body, posture), key=lambda part: part.rings[..., 0].mean())
        for part in parts:
            points = camera.reference_to_optical(part.rings)
            # Parts behind the camera are skipped; clipping is not needed for synthetic people.
            if not in_front(points).all():
                continue
            pixels = np.asarray(np.rint(camera.project(points) * (1 << _SHIFT)), dtype=np.int32)
            for i, pair in enumerate(pairwise(pixels)):
                hull = cv2.convexHull(np.concatenate(pair))
                # The brightness varies along a part, so that it is not uniform.
                level = part.brightness + 6 * (i % 3)
                cv2.fillConvexPoly(shade, hull, level, cv2.LINE_8, _SHIFT)
                cv2.fillConvexPoly(cover, hull, 255, cv2.LINE_8, _SHIFT)
        size = (self.camera.width, self.camera.height)
        small = [
            cv2.resize(layer, size, interpolation=cv2.INTER_AREA).astype(np.float32)
            for layer in (shade, cover)
        ]
        return small[0], small[1] / np.float32(255.0)
