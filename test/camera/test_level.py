"""Cameras that are upside down, on their side, or mirrored."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration, unrectified
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

K = np.array([(100.0, 0.0, 20.0), (0.0, 120.0, 30.0), (0.0, 0.0, 1.0)])
BENT = np.array([-0.1, 0.02, 0.003, -0.002, 0.0])
IMAGE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
POINTS_M = np.array([(0.1, -0.05, 1.0), (-0.12, 0.1, 1.2)])


@pytest.mark.parametrize("is_mirrored", [False, True])
@pytest.mark.parametrize("quarters", [-2, -1, 0, 1, 2])
def test_a_quarter_turn_exchanges_width_and_height(quarters: int, is_mirrored: bool) -> None:
    """The image of a camera that is turned clockwise is turned clockwise to be level again."""
    sent = Calibration(
        64, 48, K, np.zeros(5), roll_rad=quarters * math.pi / 2, is_mirrored=is_mirrored
    )
    pipeline = SilhouettePipeline(sent, (64, 48))
    expected = np.rot90(IMAGE, -quarters)
    expected = expected[:, ::-1] if is_mirrored else expected
    level = pipeline.prepare(IMAGE)
    np.testing.assert_array_equal(level, expected)
    camera = pipeline.camera
    assert level.shape[:2] == (camera.height, camera.width)
    px = np.array([(5.0, 7.0), (40.0, 30.0)])
    placed = sent.rectified(px, camera.width, camera.height)
    for (column, row), (u, v) in zip(px.astype(int), placed.round().astype(int), strict=True):
        np.testing.assert_array_equal(level[v, u], IMAGE[row, column])


@pytest.mark.parametrize("is_mirrored", [False, True])
@pytest.mark.parametrize("distortion", [np.zeros(5), BENT])
@pytest.mark.parametrize("roll_deg", [-180, -135, -90, -50, -20, 0, 30, 44, 46, 90, 120, 179])
def test_a_level_camera_sees_points_where_the_turned_one_does(
    roll_deg: float, distortion: np.ndarray, is_mirrored: bool
) -> None:
    sent = Calibration(
        64, 48, K, distortion, roll_rad=math.radians(roll_deg), is_mirrored=is_mirrored
    )
    size = sent.level_size(64, 48)
    level = sent.camera(*size).project(POINTS_M @ sent.turn().T)
    raw = unrectified(sent, level, *size)
    np.testing.assert_allclose(sent.rectified(raw, *size), level, atol=1e-3)
    if not distortion.any():
        straight = Calibration(64, 48, K, distortion).camera(64, 48).project(POINTS_M)
        np.testing.assert_allclose(raw, straight, atol=1e-6)


def test_up_to_45_degrees_size_and_focal_lengths_stay() -> None:
    upright, turned = (
        Calibration(64, 48, K, BENT, roll_rad=math.radians(deg)).camera(64, 48) for deg in (0, 44)
    )
    assert upright == turned
