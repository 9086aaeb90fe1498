"""Height and depth of the shoulder joints, out of outlines drawn by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.shoulders import (
    CROWN,
    GIRDLE_RISE,
    SHOULDER_TOP,
    robust_mean,
    shoulder_height_m,
    shoulders_forward_m,
    top_m,
)

# At 2 m a pixel is 1 cm.
CAMERA = Camera(320, 240, 200.0, 200.0, 159.5, 119.5)
DISTANCE_M = 2.0
SPAN_M = 1.6


def consistent(joint_row: float, block: Callable[..., np.ndarray]) -> np.ndarray:
    """Somebody whose shoulders and crown are as high above the joints as people's."""
    top = round(joint_row + 0.5 - 100 * SHOULDER_TOP * SPAN_M)
    crown = round(joint_row + 0.5 - 100 * CROWN * SPAN_M)
    figure: np.ndarray = block(top, 220, 135, 185) | block(crown, top, 152, 168)
    return figure


def test_the_top_of_an_outline_by_hand(block: Callable[..., np.ndarray]) -> None:
    figure = block(80, 220, 140, 180) | block(60, 80, 152, 168)
    # The upper edges of the rows 80 and 60 are 40 and 60 px above the middle of the image.
    assert top_m(figure, CAMERA, DISTANCE_M, 0.15) == pytest.approx(0.40)
    assert top_m(figure, CAMERA, DISTANCE_M, 0.0) == pytest.approx(0.60)
    assert np.isnan(top_m(figure, CAMERA, DISTANCE_M, 0.5))
    assert np.isnan(top_m(np.zeros_like(figure), CAMERA, DISTANCE_M, 0.0))


def test_readings_that_agree_give_the_height(block: Callable[..., np.ndarray]) -> None:
    breadth_m, joint_m = 0.34, 0.20
    raised_m = joint_m + GIRDLE_RISE * breadth_m
    front = consistent(119.5 - 100 * joint_m, block)
    found = shoulder_height_m(front, CAMERA, DISTANCE_M, raised_m, 0.0, breadth_m, SPAN_M)
    assert found == pytest.approx(joint_m, abs=0.005)  # outlines are whole pixels


def test_missing_shoulders_hardly_lower_the_height(block: Callable[..., np.ndarray]) -> None:
    breadth_m, joint_m = 0.34, 0.20
    raised_m = joint_m + GIRDLE_RISE * breadth_m
    front = consistent(119.5 - 100 * joint_m, block)
    front[:130, :150] = 0  # 37 cm of the right shoulder
    found = shoulder_height_m(front, CAMERA, DISTANCE_M, raised_m, 0.0, breadth_m, SPAN_M)
    assert found == pytest.approx(joint_m, abs=0.01)


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
