"""Stature and heights out of the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.skeleton import Skeleton
from cardbox_tracker.measuring.stature import height_of_row_m, stature_m

CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
# 3.3 px a centimetre at 1 m, so 1 px is a centimetre at 3.3 m.
DISTANCE_M = 3.3


def seen(rows: int, crown_row: int = 30) -> np.ndarray:
    """Somebody of so many rows below their crown."""
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[crown_row : crown_row + rows, 130:190] = 255
    return silhouette


def skeleton(stature_m: float, crown_row: int = 30) -> Skeleton:
    """The arms of somebody of that stature."""
    crown_m = height_of_row_m(CAMERA, crown_row - 0.5, DISTANCE_M)
    return Skeleton(
        shoulder_breadth_m=0.2 * stature_m,
        shoulder_height_m=crown_m - 0.218 * stature_m,
        upper_arm_m=0.16 * stature_m,
        forearm_m=0.21 * stature_m,
        span_m=1.005 * stature_m,
    )


@pytest.mark.parametrize(
    ("row", "pitch_deg", "expected_m"),
    [
        (119.5, 0.0, 0.0),
        (119.5 + 33.0, 0.0, -0.2),
        (119.5 - 330.0, 0.0, 2.0),
        # A camera that looks down by 45 degrees sees what is 2 m below its height in the middle.
        (119.5, 45.0, -2.0),
        (119.5 - 330.0, 45.0, 0.0),
    ],
)
def test_height_of_a_row_by_hand(row: float, pitch_deg: float, expected_m: float) -> None:
    camera = CAMERA.with_pitch(np.radians(pitch_deg))
    assert height_of_row_m(camera, row, 2.0) == pytest.approx(expected_m, abs=1e-12)


@given(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5), st.floats(0.5, 5.0))
def test_the_height_of_a_row_is_that_of_the_point_seen_there(
    height_m: float, pitch_rad: float, distance_m: float
) -> None:
    camera = CAMERA.with_pitch(pitch_rad)
    row = camera.project(camera.reference_to_optical(np.array([-distance_m, 0.3, height_m])))[1]
    assert height_of_row_m(camera, row, distance_m) == pytest.approx(height_m, abs=1e-9)


@pytest.mark.parametrize("rows", [165, 190])
def test_whose_feet_are_in_the_image_needs_no_guess(rows: int) -> None:
    found = stature_m(seen(rows), skeleton(1.75), CAMERA, DISTANCE_M)
    assert found == pytest.approx(rows / 100)


def test_a_desk_before_the_legs_is_not_taken_for_feet() -> None:
    """Whoever spans 1.8 m is not 1.2 m tall."""
    assert stature_m(seen(120), skeleton(1.8), CAMERA, DISTANCE_M) > 1.7


def test_all_guesses_agree_for_the_mean_person() -> None:
    found = stature_m(seen(210), skeleton(1.68), CAMERA, DISTANCE_M)
    assert found == pytest.approx(1.68, abs=1e-3)


@pytest.mark.parametrize("stature", [1.4, 1.55, 1.8, 1.95])
def test_the_guess_lies_between_the_mean_and_what_the_upper_body_tells(stature: float) -> None:
    """Most of what somebody is taller or smaller than others is believed, and never all of it."""
    found = stature_m(seen(210), skeleton(stature), CAMERA, DISTANCE_M)
    believed = (found - 1.68) / (stature - 1.68)
    assert 0.7 < believed < 1.0


def test_a_head_that_contradicts_the_span_counts_less() -> None:
    true = skeleton(1.7)
    # A hat of 20 cm.
    low = replace(true, shoulder_height_m=true.shoulder_height_m - 0.2)
    assert stature_m(seen(210), low, CAMERA, DISTANCE_M) == pytest.approx(1.7, abs=0.08)


@pytest.mark.parametrize(("stature", "expected_m"), [(0.6, 1.1), (3.5, 2.2)])
def test_nobody_is_smaller_or_taller_than_people_are(stature: float, expected_m: float) -> None:
    assert stature_m(seen(210), skeleton(stature), CAMERA, DISTANCE_M) == expected_m
