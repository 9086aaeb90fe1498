"""The direction of a head from the points of its face, against projections made here."""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, radians, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import NECK_LIMITS, neck_rotation
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.head import FACE_M, FACE_POINTS, HeadTracker, fit_neck

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad=0.1)
BODY = BodyModel.of(hip_height_m=-0.3, camera_pitch_rad=0.1)
UPRIGHT = np.zeros(12)
HEAD_HEIGHT = 0.24 / 0.23
"""Height of the head of ``BODY`` compared with that of the face model."""


def image_points(px: FloatArray) -> ImagePoints:
    """Points of a face, (5, 2), ordered as ``FACE_POINTS``."""
    named = {name: (*xy, 1.0) for name, xy in zip(FACE_POINTS, px.tolist(), strict=True)}
    return ImagePoints.of(named)


def face(
    yaw_deg: float, pitch_deg: float, posture: FloatArray = UPRIGHT, moved_m: float = 0.0
) -> ImagePoints:
    """What a detector without errors sees of a head, ``moved_m`` across from the model's."""
    frames = pose(BODY.rigid, posture)
    rotation = frames.torso_rotation @ neck_rotation(np.radians([yaw_deg, pitch_deg]))
    points = frames.head + (0.0, moved_m, 0.0) + HEAD_HEIGHT * FACE_M @ rotation.T
    return image_points(CAMERA.project(CAMERA.reference_to_optical(points)))


def found_deg(points: ImagePoints, posture: FloatArray = UPRIGHT) -> list[float]:
    neck = fit_neck(points, BODY, CAMERA, posture)
    assert neck is not None
    return [float(value) for value in np.degrees(neck.angles)]


def without(points: ImagePoints, *names: str) -> ImagePoints:
    scores = points.scores.copy()
    scores[[POINT_INDEX[name] for name in names]] = 0.0
    return ImagePoints(points.px, scores)


def swapped(points: ImagePoints, *pairs: str) -> ImagePoints:
    order = list(range(len(POINT_NAMES)))
    for pair in pairs:
        left, right = POINT_INDEX[f"left_{pair}"], POINT_INDEX[f"right_{pair}"]
        order[left], order[right] = right, left
    return ImagePoints(points.px[order], points.scores[order])


@pytest.mark.parametrize(("yaw_deg", "pitch_deg"), [(0, 0), (30, 0), (-30, 0), (0, 20), (0, -20)])
def test_a_projection_worked_by_hand_gives_its_angles(yaw_deg: float, pitch_deg: float) -> None:
    """A far, level camera sees x to the right = the person's left, and y down."""
    camera = Camera(320, 240, 3000.0, 3000.0, 159.5, 119.5)
    body = BodyModel.of(distance_m=20.0, hip_height_m=-0.7)
    y, p = radians(yaw_deg), radians(pitch_deg)
    px_per_m = HEAD_HEIGHT * 3000.0 / 20.0
    px = np.array(
        [
            (
                159.5 + px_per_m * (sin(y) * cos(p) * x + cos(y) * left + sin(y) * sin(p) * up),
                119.5 - px_per_m * (-sin(p) * x + cos(p) * up),
            )
            for x, left, up in FACE_M.tolist()
        ]
    )
    neck = fit_neck(image_points(px), body, camera, UPRIGHT)
    assert neck is not None
    np.testing.assert_allclose(np.degrees(neck.angles), (yaw_deg, pitch_deg), atol=1.5)


@settings(max_examples=60, deadline=None)
@given(
    yaw_deg=st.floats(-60, 60),
    pitch_deg=st.floats(-40, 40),
    torso_deg=st.tuples(st.floats(-15, 15), st.floats(-15, 30), st.floats(-30, 30)),
    moved_m=st.floats(-0.05, 0.05),
)
def test_a_face_without_noise_gives_its_angles_back(
    yaw_deg: float, pitch_deg: float, torso_deg: tuple[float, float, float], moved_m: float
) -> None:
    posture = np.zeros(12)
    posture[1:4] = np.radians(torso_deg)
    found = found_deg(face(yaw_deg, pitch_deg, posture, moved_m), posture)
    # The prior draws a head that turns or nods far towards the middle.
    np.testing.assert_allclose(found, (yaw_deg, pitch_deg), atol=1.5, rtol=0.12)


def test_a_face_to_the_persons_left_has_a_positive_yaw() -> None:
    """The nose moves to the right of the image, whose centre of the eyes stays."""
    frontal = face(0, 0)
    px = frontal.px.copy()
    px[POINT_INDEX["nose"], 0] += 4.0
    yaw_deg, _ = found_deg(ImagePoints(px, frontal.scores))
    assert yaw_deg > 5.0


def test_one_eye_and_one_ear_may_be_hidden() -> None:
    found = found_deg(without(face(40, 5), "right_eye", "right_ear"))
    np.testing.assert_allclose(found, (40, 5), atol=6.0)


@pytest.mark.parametrize(
    "names", [("nose", "left_eye", "right_eye"), ("left_eye", "left_ear", "nose", "right_ear")]
)
def test_two_points_are_too_few(names: tuple[str, ...]) -> None:
    assert fit_neck(without(face(10, 0), *names), BODY, CAMERA, UPRIGHT) is None


def test_fewer_points_are_less_certain() -> None:
    full = fit_neck(face(20, 0), BODY, CAMERA, UPRIGHT)
    part = fit_neck(without(face(20, 0), "left_ear"), BODY, CAMERA, UPRIGHT)
    assert full is not None
    assert part is not None
    assert (part.stddev > full.stddev).all()


@pytest.mark.parametrize("pairs", [("eye",), ("ear",), ("eye", "ear")], ids="+".join)
@pytest.mark.parametrize("yaw_deg", [-30.0, 0.0, 30.0])
def test_exchanged_sides_are_no_face(pairs: tuple[str, ...], yaw_deg: float) -> None:
    neck = fit_neck(swapped(face(yaw_deg, 0), *pairs), BODY, CAMERA, UPRIGHT)
    assert neck is None or (np.degrees(neck.stddev) > 15.0).any()


def test_the_face_of_somebody_else_is_not_taken() -> None:
    assert fit_neck(face(0, 0, moved_m=0.5), BODY, CAMERA, UPRIGHT) is None


def test_a_head_turned_beyond_its_limits_is_refused() -> None:
    """The back of a head: a detector invents the points of its face."""
    assert fit_neck(face(150, 0), BODY, CAMERA, UPRIGHT) is None
    assert fit_neck(face(100, 0), BODY, CAMERA, UPRIGHT) is None
    near = fit_neck(face(90, 0), BODY, CAMERA, UPRIGHT)
    assert near is not None and near.angles[0] == NECK_LIMITS[0, 1]


@pytest.mark.parametrize(("away_px", "is_face"), [(20.0, True), (35.0, False)])
def test_points_that_are_no_face_are_refused(away_px: float, is_face: bool) -> None:
    points = face(0, 0)
    points.px[POINT_INDEX["left_ear"]] += away_px, 0.0
    assert (fit_neck(points, BODY, CAMERA, UPRIGHT) is not None) == is_face


@pytest.mark.parametrize(("focal_px", "is_sure"), [(100.0, True), (45.0, False)])
def test_a_face_that_is_too_small_is_refused(focal_px: float, is_sure: bool) -> None:
    """Its points deviate by 13 or 25 degrees of the neck."""
    camera, ahead = replace(CAMERA, fx=focal_px, fy=focal_px), face(0, 0)
    px = (ahead.px - (CAMERA.cx, CAMERA.cy)) * focal_px / CAMERA.fx + (CAMERA.cx, CAMERA.cy)
    assert (fit_neck(replace(ahead, px=px), BODY, camera, UPRIGHT) is not None) == is_sure


def frame(points: ImagePoints | None, interval_s: float = 0.1) -> Frame:
    nothing = np.zeros((240, 320), np.uint8)
    channels = {"silhouette": nothing} | ({} if points is None else {"points": points})
    return Frame(CAMERA, channels, 240, 0, interval_s=interval_s)


ESTIMATE = Estimate(TRACKING, UPRIGHT, np.full(12, radians(5.0)))


def test_an_estimate_without_points_stays_as_it_is() -> None:
    tracker = HeadTracker(BODY, CAMERA)
    assert tracker.see(frame(None), ESTIMATE) is ESTIMATE


def test_the_torsos_deviation_is_part_of_the_necks() -> None:
    exact = replace(ESTIMATE, posture_stddev=np.zeros(12))
    seen: list[Any] = [
        HeadTracker(BODY, CAMERA).see(frame(face(10, 5)), found).neck_stddev
        for found in (exact, ESTIMATE)
    ]
    np.testing.assert_allclose(seen[1], np.hypot(seen[0], radians(5.0)))


def test_the_direction_is_smoothed_and_kept_for_a_moment() -> None:
    tracker = HeadTracker(BODY, CAMERA)
    first = tracker.see(frame(face(0, 0)), ESTIMATE)
    turned = tracker.see(frame(face(40, 0)), ESTIMATE)
    hidden = tracker.see(frame(None), ESTIMATE)
    gone = tracker.see(frame(None, interval_s=1.0), ESTIMATE)
    assert first.neck is not None
    assert turned.neck is not None
    assert turned.neck_stddev is not None
    assert hidden.neck_stddev is not None
    assert 5.0 < np.degrees(turned.neck[0]) < 35.0
    np.testing.assert_array_equal(hidden.neck, turned.neck)
    # By a rad a second.
    np.testing.assert_allclose(hidden.neck_stddev, np.hypot(turned.neck_stddev, 0.1))
    assert gone.neck is None
    again = tracker.see(frame(face(40, 0)), ESTIMATE)
    assert again.neck is not None
    assert np.degrees(again.neck[0]) == pytest.approx(40.0, abs=2.0)


@pytest.mark.parametrize(("interval_s", "kept"), [(0.05, 0.5), (0.3, exp(-2.0))])
def test_the_last_direction_keeps_half_or_less_of_its_weight(
    interval_s: float, kept: float
) -> None:
    tracker, alone = HeadTracker(BODY, CAMERA), HeadTracker(BODY, CAMERA)
    first = tracker.see(frame(face(0, 0), interval_s), ESTIMATE).neck
    found = tracker.see(frame(face(40, 0), interval_s), ESTIMATE).neck
    turned = alone.see(frame(face(40, 0)), ESTIMATE).neck
    assert first is not None and turned is not None and found is not None
    np.testing.assert_allclose(found, kept * first + (1.0 - kept) * turned, atol=1e-12)


def test_a_lost_person_has_no_direction() -> None:
    tracker = HeadTracker(BODY, CAMERA)
    tracker.see(frame(face(0, 0)), ESTIMATE)
    assert tracker.see(frame(face(0, 0)), Estimate(LOST)).neck is None
