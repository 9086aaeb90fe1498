"""Random cameras see the person; walls and light are drawn once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.vision.camera import Camera
from learning.rendering import Rendering
from learning.room import Room, Viewpoint, draw_viewpoint


def test_points_straight_ahead_and_beside() -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
    viewpoint = Viewpoint(camera, np.array([3.0, 0.5, 1.2]))
    assert viewpoint.optical(np.array([1.0, 0.5, 1.2])) == pytest.approx([0.0, 0.0, 2.0])
    # The person's left is to the right; x points right and y down.
    beside = viewpoint.optical(np.array([[1.0, 0.7, 1.2], [1.0, 0.5, 1.3]]))
    assert beside == pytest.approx(np.array([[0.2, 0.0, 2.0], [0.0, -0.1, 2.0]]))


def test_a_camera_that_looks_down_sees_the_floor_ahead() -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=np.radians(30.0))
    viewpoint = Viewpoint(camera, np.array([3.0, 0.0, 1.0]))
    # 1 m lower, and 1 m / tan 30 degrees ahead.
    floor = np.array([3.0 - np.sqrt(3.0), 0.0, 0.0])
    assert viewpoint.optical(floor) == pytest.approx([0.0, 0.0, 2.0], abs=1e-12)


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1), st.floats(1.1, 2.0))
def test_every_camera_sees_the_shoulders(seed: int, stature_m: float) -> None:
    viewpoint = draw_viewpoint(np.random.default_rng(seed), stature_m)
    camera = viewpoint.camera
    shoulders = stature_m * np.array([[0.0, 0.11, 0.82], [0.0, -0.11, 0.82]])
    optical_m = viewpoint.optical(shoulders)
    assert (optical_m[:, 2] > 0.5).all()
    left, right = camera.project(optical_m)
    for pixel in (left, right):
        assert 0 <= pixel[0] < camera.width and 0 <= pixel[1] < camera.height
    assert left[0] > right[0]
    assert {camera.width, camera.height} == {320, 240} and 1.0 <= viewpoint.place_m[0] <= 5.0


def test_raised_hands_mostly_remain_in_the_image() -> None:
    seen = []
    for seed in range(300):
        viewpoint = draw_viewpoint(np.random.default_rng(seed), 1.7)
        row = viewpoint.camera.project(viewpoint.optical(np.array([0.0, 0.2, 1.7])))[1]
        seen.append(0 <= row < viewpoint.camera.height)
    assert np.mean(seen) > 0.85


def rendering(camera: Camera) -> Rendering:
    depth_m = np.full((camera.height, camera.width), np.inf)
    depth_m[100:200, 50:150] = 2.0
    colour = np.zeros((camera.height, camera.width, 3), np.uint8)
    colour[100:200, 50:150] = 200, 100, 10
    return Rendering(depth_m, colour)


def test_images_are_bgr_and_noisy_before_a_constant_wall() -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
    for seed in range(5):
        room = Room(camera, np.random.default_rng(seed))
        one, other = room.image(rendering(camera)), room.image(rendering(camera))
        assert one.shape == (240, 320, 3) and one.dtype == np.uint8
        blue, green, red = one[110:190, 60:140].reshape(-1, 3).mean(axis=0)
        assert blue < green < red
        assert (one != other).any()
        # The same wall, but for the noise, whose deviation is 6 at most.
        assert np.abs(one.astype(float) - other).mean() < 8.0
        assert np.linalg.norm(room.light) == pytest.approx(1.0)


def test_the_same_seed_gives_the_same_images() -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
    one, other = (Room(camera, np.random.default_rng(7)).image(rendering(camera)) for _ in "ab")
    np.testing.assert_array_equal(one, other)
