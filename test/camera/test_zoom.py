"""Images that stay the same prove a new focal length wrong; those of a camera that zooms do not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.zoom import ZoomWitness

OLD = Calibration.of_fov(320, 240, 52.0)


def zoomed(factor: float) -> Calibration:
    k = OLD.k.copy()
    k[[0, 1], [0, 1]] *= factor
    return replace(OLD, k=k)


class Room:
    """Images of a person who sways before a wall, with noise."""

    def __init__(self, texture: float) -> None:
        self.rng = np.random.default_rng(3)
        noise = self.rng.normal(0, 1, (240, 320)).astype(np.float32)
        noise = cv2.GaussianBlur(noise, (0, 0), 5)
        self.wall = 120 + texture * noise / noise.std()
        self.noise = self.rng.normal(0, 2, (480, 640))
        self.time = 0.0

    def image(self, zoom: float = 1.0, light: float = 1.0) -> np.ndarray:
        self.time += 1 / 15
        seen = self.wall.copy()
        aside = round(8 * np.sin(self.time))
        seen[80:, 140 + aside : 190 + aside] = 60
        cv2.circle(seen, (165 + aside, 65), 18, (170.0,), -1)
        turned = cv2.getRotationMatrix2D((159.5, 119.5), 0.0, zoom)
        seen = light * cv2.warpAffine(seen, turned, (320, 240), borderMode=cv2.BORDER_REFLECT)
        # Parts of one image of noise; drawing it anew takes longer than the witness.
        row, column = self.rng.integers(0, (240, 320))
        noise = self.noise[row : row + 240, column : column + 320]
        return np.clip(seen + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("texture", [0.0, 20.0])
@pytest.mark.parametrize("is_first", [True, False])
@pytest.mark.parametrize("factor", [0.77, 1.1, 1.3])
@pytest.mark.parametrize("light", [1.0, 1.3])
def test_a_zoom_is_told_from_a_wrong_calibration(
    texture: float, is_first: bool, factor: float, light: float
) -> None:
    """The CameraInfo comes before its image or after it, and the light may change, too."""
    for zoom in (1.0, factor):
        room, witness = Room(texture), ZoomWitness()
        for number in range(60):
            witness.look(room.image())
            if number % 20 == 0:
                witness.remember()
        if is_first:
            witness.mark()
        witness.look(room.image(zoom, light))
        if not is_first:
            witness.mark()
        for _ in range(30):
            witness.look(room.image(zoom, light))
        assert witness.contradicts(OLD, zoomed(factor)) is (zoom == 1.0)


def test_a_driver_may_zoom_before_it_says_so() -> None:
    room, witness = Room(20.0), ZoomWitness()
    for _ in range(3):
        witness.look(room.image())
        witness.remember()
    for _ in range(10):
        witness.look(room.image(1.3))
    witness.mark()
    witness.look(room.image(1.3))
    assert not witness.contradicts(OLD, zoomed(1.3))


def test_nothing_is_contradicted_without_evidence() -> None:
    witness = ZoomWitness()
    witness.mark()
    assert not witness.contradicts(OLD, zoomed(1.3)), "no images"
    for image in (np.zeros((240, 320), np.uint8), np.zeros((240, 320, 3), np.uint8)):
        witness.look(image)
        witness.mark()
        witness.look(image)
        assert not witness.contradicts(OLD, zoomed(1.3)), "a dark image"
        assert not witness.contradicts(OLD, zoomed(50.0)), "nothing of the image is left"
    room = Room(20.0)
    witness.look(room.image())
    witness.mark()
    witness.look(cv2.resize(room.image(), (320, 180)))
    assert not witness.contradicts(OLD, zoomed(1.3)), "another shape"
    assert not witness.contradicts(OLD, zoomed(1.01)), "no more than an autofocus"
