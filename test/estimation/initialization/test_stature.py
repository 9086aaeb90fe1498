"""Stature and heights out of the image."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.body.sizes import DEFAULT_SIZES
from cardbox_tracker.estimation.initialization.stature import SPAN, height_of_row_m, stature_m
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)


def block(top: int, bottom: int, left: int, right: int) -> np.ndarray:
    silhouette = np.zeros((240, 320), np.uint8)
    silhouette[top:bottom, left:right] = 255
    return silhouette


def outstretched(rows: int) -> np.ndarray:
    """A person of so many rows with level arms of their span, the crown in row 30."""
    arms = block(30, 30 + rows, 130, 190)
    half = round(SPAN * rows / 2)
    shoulder = 30 + round(0.19 * rows)
    return arms | block(shoulder - 4, shoulder + 5, 160 - half, 160 + half)


def seen(body: BodyModel, name: str) -> np.ndarray:
    camera = CAMERA.with_pitch(body.camera_pose.pitch_rad)
    return render(cardbox_patches(body, reference_posture(name)), camera)


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


@pytest.mark.parametrize(("rows", "expected_m"), [(165, 1.65), (190, 1.9)])
def test_whose_feet_are_in_the_image_needs_no_guess(rows: int, expected_m: float) -> None:
    # 3.3 px a centimetre at 1 m, so 1 px is a centimetre at 3.3 m.
    front = block(30, 30 + rows, 130, 190)
    assert stature_m({"front": front, "arms": outstretched(rows)}, CAMERA, 3.3) == pytest.approx(
        expected_m
    )


def test_a_desk_before_the_legs_is_not_taken_for_feet() -> None:
    """Whoever spans 1.8 m is not 1.2 m tall."""
    arms = outstretched(180)
    arms[150:] = 0
    front = block(30, 150, 130, 190)
    assert stature_m({"front": front, "arms": arms}, CAMERA, 3.3) == pytest.approx(1.8, abs=0.06)


def test_upper_arms_that_were_not_cut_out_are_done_without() -> None:
    arms = outstretched(180)
    arms[:, 100:130] = 0
    arms[:, 190:220] = 0
    front = block(30, 230, 130, 190)
    assert stature_m({"front": front, "arms": arms}, CAMERA, 3.3) == pytest.approx(1.8, abs=0.25)


@pytest.mark.parametrize("pitch_deg", [0.0, 5.0])
@pytest.mark.parametrize("factor", [0.85, 0.95, 1.0, 1.08])
def test_the_upper_body_tells_the_stature(factor: float, pitch_deg: float) -> None:
    """Half of what somebody is taller or smaller than others is seen, and never more than all.

    The sizes are by default those of 1.72 m.
    """
    body = BodyModel.of(
        DEFAULT_SIZES * factor, hip_height_m=-0.51, camera_pitch_rad=np.radians(pitch_deg)
    )
    references = {name: seen(body, name) for name in ("front", "arms")}
    found = stature_m(references, CAMERA.with_pitch(body.camera_pose.pitch_rad), 2.0)
    assert found == pytest.approx(1.72 * factor, abs=0.07)


def test_the_stature_grows_with_the_span_of_the_arms() -> None:
    found = []
    for factor in (0.8, 0.9, 1.0, 1.1):
        body = BodyModel.of(DEFAULT_SIZES * factor, hip_height_m=-0.51)
        references = {name: seen(body, name) for name in ("front", "arms")}
        found.append(stature_m(references, CAMERA, 2.0))
    assert found == sorted(found)
    assert found[-1] - found[0] > 0.25


@pytest.mark.parametrize(("half_width", "expected_m"), [(15, 1.1), (150, 2.2)])
def test_nobody_is_smaller_or_taller_than_people_are(half_width: int, expected_m: float) -> None:
    front = block(20, 240, 130, 190)
    if expected_m == 1.1:
        front = block(150, 240, 130, 190)
    arms = block(60, 240, 160 - half_width, 160 + half_width)
    distance_m = 1.0 if expected_m == 1.1 else 6.0
    assert stature_m({"front": front, "arms": arms}, CAMERA, distance_m) == expected_m


def test_the_span_of_a_straight_line_is_that_of_the_proportion() -> None:
    """All three guesses agree where a person of the mean stature has the mean proportions."""
    # At 2 m a pixel is 6.06 mm: stature 1.71 m, span 1.684 m, shoulders 0.325 m below the crown.
    span_px = round(1.71 * SPAN * 330 / 2)
    left = 160 - span_px // 2
    front = block(66, 240, 130, 190)
    arms = block(66 + 52, 66 + 56, left, left + span_px)
    assert stature_m({"front": front, "arms": arms}, CAMERA, 2.0) == pytest.approx(1.71, abs=0.02)
