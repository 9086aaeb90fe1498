"""Depth of the shoulder joints, out of outlines drawn by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.shoulders import (
    robust_mean,
    shoulders_forward_m,
)

# At 2 m a pixel is 1 cm.
CAMERA = Camera(320, 240, 200.0, 200.0, 159.5, 119.5)
DISTANCE_M = 2.0
SPAN_M = 1.6


@pytest.mark.parametrize("chest_px", [-4, 0, 6])
def test_the_depth_of_the_shoulders_by_hand(
    chest_px: int, block: Callable[..., np.ndarray]
) -> None:
    side = block(90, 130, 145 + chest_px, 165 + chest_px) | block(130, 220, 140, 170)
    seen = [
        shoulders_forward_m(side, CAMERA, DISTANCE_M, 0.20, SPAN_M, turn)
        for turn in ("left", "right")
    ]
    # Half of what is seen is believed.
    assert seen == pytest.approx([0.005 * chest_px, -0.005 * chest_px])


def test_the_depth_of_the_shoulders_is_limited(block: Callable[..., np.ndarray]) -> None:
    side = block(90, 130, 200, 220) | block(130, 220, 140, 170)
    found = shoulders_forward_m(side, CAMERA, DISTANCE_M, 0.20, SPAN_M, "left")
    assert found == pytest.approx(0.04)


def test_hips_out_of_the_image_say_nothing(block: Callable[..., np.ndarray]) -> None:
    side = block(90, 120, 150, 170)
    assert shoulders_forward_m(side, CAMERA, DISTANCE_M, 0.20, SPAN_M, "left") == 0.0


def test_a_robust_mean_of_heights() -> None:
    # Weights 4 and 1; heights can be below the camera.
    found = robust_mean(np.array([-0.010, 0.0, np.nan]), np.array([0.05, 0.10, 0.01]))
    assert found == pytest.approx(-0.008, abs=1e-4)
    far = robust_mean(np.array([-0.30, -0.31, 0.5]), np.full(3, 0.02))
    assert far == pytest.approx(-0.305, abs=0.01)
