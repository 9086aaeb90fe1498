"""Which way somebody faces who walks through the image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.search.locating import Walk

INSIDE = np.zeros((24, 32), np.uint8)
INSIDE[5:20, 10:20] = 255


def at_border(column: int) -> np.ndarray:
    silhouette = INSIDE.copy()
    silhouette[5:20, column] = 255
    return silhouette


def test_whoever_stands_is_expected_to_face_the_camera() -> None:
    walk = Walk()
    steps = [walk.see(INSIDE, 0.3, 2.0) for _ in range(20)]
    assert steps == [0.0] * 20
    assert walk.yaw_rad == 0.0


def test_a_step_is_the_change_of_direction_times_the_distance() -> None:
    walk = Walk()
    walk.see(INSIDE, 0.1, 2.0)
    assert walk.see(INSIDE, 0.13, 2.5) == pytest.approx(0.075)


@given(st.sampled_from([-1.0, 1.0]), st.floats(0.03, 0.1))
def test_whoever_walks_across_faces_where_they_go(side: float, step_m: float) -> None:
    walk = Walk()
    for i in range(30):
        walk.see(INSIDE, side * step_m * i / 2.0, 2.0)
    # Towards positive torso_y, the right of the image, is a turn to the person's left.
    assert np.degrees(walk.yaw_rad) == pytest.approx(side * 80.0)
    # Half of the way, 0.25 m times 0.95 in each image, is left after 13.5 images.
    for number in range(1, 21):
        walk.see(INSIDE, side * step_m * 29 / 2.0, 2.0)
        assert number not in (10, 20) or (walk.yaw_rad == 0.0) == (number == 20)


@given(st.floats(0.0, 0.05), st.floats(0.1, 1.0))
def test_swaying_is_not_walking(amplitude_m: float, rad_per_frame: float) -> None:
    walk = Walk()
    for i in range(100):
        walk.see(INSIDE, amplitude_m * np.sin(rad_per_frame * i) / 2.0, 2.0)
        assert walk.yaw_rad == 0.0


@pytest.mark.parametrize(("column", "degrees"), [(0, 80.0), (-1, -80.0)])
def test_whoever_appears_at_a_border_comes_in(column: int, degrees: float) -> None:
    walk = Walk()
    walk.see(at_border(column), 0.0, 2.0)
    assert np.degrees(walk.yaw_rad) == pytest.approx(degrees)


def test_whoever_fills_the_image_comes_from_nowhere() -> None:
    walk = Walk()
    walk.see(np.full((24, 32), 255, np.uint8), 0.0, 2.0)
    assert walk.yaw_rad == 0.0
