"""Grid masks of the expected person: their points and their dilation."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import JOINT_LIMITS, reference_posture
from cardbox_tracker.tracking.person_masks import (
    HIP,
    LEFT,
    NECK,
    RIGHT,
    PersonDrawer,
    PersonPoints,
    grown,
)

CAMERA = Camera(160, 120, 100.0, 90.0, 79.5, 59.5).with_pitch(0.2)
BODY = BodyModel.of(hip_height_m=-0.4, camera_pitch_rad=0.2)


def projected(points_m: np.ndarray) -> np.ndarray:
    optical_m = CAMERA.reference_to_optical(points_m)
    return np.column_stack([CAMERA.project(optical_m), CAMERA.fx / optical_m[:, 2]])


@given(st.lists(st.floats(0.0, 1.0), min_size=12, max_size=12), st.floats(-1.0, 0.5))
def test_points_are_those_of_the_kinematics(shares: list[float], x_m: float) -> None:
    low, high = JOINT_LIMITS.T
    posture = low + np.array(shares) * (high - low)
    state = np.append(posture, [x_m, 0.1])
    place = BODY.placement
    moved = replace(place, distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + 0.1)
    frames = pose(replace(BODY, placement=moved), posture)
    expected = [frames.hip, frames.neck, frames.head]
    for arm in (frames.left, frames.right):
        expected += [arm.shoulder, arm.elbow, arm.hand + 0.15 * (arm.hand - arm.elbow)]
    found = PersonPoints(BODY, CAMERA).of(state)
    np.testing.assert_allclose(found, projected(np.array(expected)), rtol=1e-9, atol=1e-9)


def test_a_posture_of_the_paper_is_at_the_measured_place() -> None:
    points, posture = PersonPoints(BODY, CAMERA), reference_posture("front")
    np.testing.assert_array_equal(points.of(posture), points.of(np.append(posture, [0.0, 0.0])))


def test_a_person_who_stands_in_the_camera_stays_in_front_of_it() -> None:
    state = np.append(reference_posture("front"), [BODY.placement.distance_m, 0.0])
    points = PersonPoints(BODY, CAMERA.with_pitch(0.0)).of(state)
    assert points[HIP, 2] == pytest.approx(100.0 / NEAREST_M)
    assert points[NECK, 1] < points[HIP, 1]
    assert points[LEFT, 0] > points[RIGHT, 0]


@given(
    st.tuples(st.integers(1, 60), st.integers(1, 119)),
    st.integers(0, 40),
    st.floats(0.0, 1.0),
    st.integers(0, 2**32 - 1),
)
def test_growth_is_the_dilation_by_a_disc(
    shape: tuple[int, int], radius: int, share: float, seed: int
) -> None:
    # A few cells, many, or none.
    mask = (np.random.default_rng(seed).random(shape) < share**8).astype(np.uint8)
    wide = 2 * radius + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide))
    np.testing.assert_array_equal(grown(mask, radius), cv2.dilate(mask, disc))


def test_the_band_is_between_the_body_and_the_cells_near_it() -> None:
    masks = PersonDrawer(BODY, CAMERA).masks(reference_posture("front"), 0.2)
    core, band, near = (np.count_nonzero(mask) for mask in (masks.core, masks.band(), masks.near))
    assert 0 < core < band < near
    assert not np.any(masks.core & ~masks.band())
    assert not np.any(masks.band() & ~masks.near)
    assert not np.any(masks.near & ~masks.reach)
