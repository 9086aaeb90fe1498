"""A room with a textured wall, and a person in it who never stands quite still."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

Image = NDArray[np.uint8]


class Room:
    """Draws images (H, W) of one room, with fresh noise in each.

    Attributes:
        wall: the empty room without noise, grey levels.
    """

    WIDTH, HEIGHT = 160, 120

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        coarse = self._rng.uniform(70, 150, (12, 16)).astype(np.float32)
        self.wall = cv2.resize(coarse, (self.WIDTH, self.HEIGHT), interpolation=cv2.INTER_CUBIC)
        self._looks = self._rng.uniform(-20, 20, (self.HEIGHT, self.WIDTH)).astype(np.float32)
        self._looks = cv2.GaussianBlur(self._looks, (0, 0), 2) * 3

    def person(self, at: float) -> NDArray[np.bool_]:
        """Return where a person is whose middle stands at column ``at``."""
        return self._alpha(at) > 0.5

    def image(
        self,
        at: float | None = None,
        *,
        sway_px: float = 0.5,
        gain: float = 1.0,
        shift: tuple[int, int] = (0, 0),
    ) -> Image:
        """Return an image, of the empty room if ``at`` is None; half a px are some mm."""
        pixels = self.wall
        if at is not None:
            alpha = self._alpha(at + self._rng.uniform(-sway_px, sway_px))
            pixels = (1 - alpha) * pixels + alpha * (205 + self._looks)
        if shift != (0, 0):
            pixels = np.roll(pixels, shift[::-1], (0, 1))
        noisy = gain * pixels + self._rng.normal(0, 3, pixels.shape)
        return np.clip(noisy.round(), 0, 255).astype(np.uint8)

    def _alpha(self, at: float) -> NDArray[np.float32]:
        v, u = np.mgrid[: self.HEIGHT, : self.WIDTH].astype(np.float32)
        body = np.clip(11.5 - np.abs(u - at), 0, 1) * np.clip(v - 45, 0, 1)
        head = np.clip(8.5 - np.hypot(u - at, v - 38), 0, 1)
        return np.maximum(body, head).astype(np.float32)


@pytest.fixture(params=[0, 1, 2])
def room(request: pytest.FixtureRequest) -> Room:
    """The room, with one seed or another."""
    return Room(request.param)
