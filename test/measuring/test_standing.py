"""An outline to stand in is as high as the person."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.stature import at_height_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.sizes import SIZE_NAMES

CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)


def head_height_m(body: BodyModel) -> float:
    return float(body.sizes[SIZE_NAMES.index("head_height")])


@pytest.mark.parametrize("pitch_rad", [0.0, 0.2])
@pytest.mark.parametrize("hip_height_m", [-0.6, -0.45, -0.35])
def test_the_height_of_the_hips_is_found(hip_height_m: float, pitch_rad: float) -> None:
    body = BodyModel.of(distance_m=2.4, hip_height_m=hip_height_m, camera_pitch_rad=pitch_rad)
    patches = cardbox_patches(body, reference_posture("front"))
    silhouette = render(patches, CAMERA.with_pitch(pitch_rad))
    guess = body.with_values(hip_height_m=-0.5)
    assert at_height_of(silhouette, guess, CAMERA).placement.hip_height_m == pytest.approx(
        hip_height_m, abs=0.02
    )


def test_the_crown_lies_on_the_upper_edge_of_the_topmost_row() -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[20:, 150:170] = 255
    body = BodyModel.of(distance_m=2.5)
    placed = at_height_of(silhouette, body, CAMERA)
    head = pose(placed.rigid, np.zeros(12)).head
    # The edge at row 19.5 lies 100 px above the middle: tan is 100 / 250, whatever the pitch.
    assert head[2] + head_height_m(placed) / 2 == pytest.approx(0.4 * -head[0])


@given(st.floats(-0.5, 0.5), st.floats(1.0, 5.0), st.integers(1, 200))
def test_the_crown_projects_to_the_row(pitch_rad: float, distance_m: float, row: int) -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[row:, 150:170] = 255
    body = BodyModel.of(distance_m=distance_m, camera_pitch_rad=pitch_rad)
    placed = at_height_of(silhouette, body, CAMERA)
    if placed == body:  # higher or lower than a person can stand
        return
    crown = pose(placed.rigid, np.zeros(12)).head
    crown[2] += head_height_m(placed) / 2
    view = CAMERA.with_pitch(pitch_rad)
    assert view.project(view.reference_to_optical(crown))[1] == pytest.approx(row - 0.5)


def test_a_topmost_row_where_no_head_can_be_is_left_alone() -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[1:, 150:170] = 255
    body = BodyModel.of(distance_m=10.0)
    assert at_height_of(silhouette, body, CAMERA) == body


def test_without_anybody_it_stays() -> None:
    empty = np.zeros((240, 320), np.uint8)
    assert at_height_of(empty, BodyModel(), CAMERA) == BodyModel()
    cut_off = empty.copy()
    cut_off[:100, 100:200] = 255
    assert at_height_of(cut_off, BodyModel(), CAMERA) == BodyModel()
