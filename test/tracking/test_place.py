"""The place of a person: what it rests on, its deviation, and sources that contradict others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import YAW, reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.given_camera import GUESSED_STDDEV
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import (
    PLACE_UNCERTAIN_FROM,
    TRACKING,
    UNCERTAIN,
    Estimate,
    Place,
)
from cardbox_tracker.tracking.place import (
    DEPTH,
    MEASURED_BODY,
    SECOND_CAMERA,
    STATURE,
    PlaceWatch,
    distance_of_points,
)
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
TALL = body_from_proportions(1.80, 2.0)
MEASURED_BODY_AT_2_M = BodyModel.of(distance_m=2.0, hip_height_m=-0.6)
FRONT = reference_posture("front")
ARM_M = TALL.size("upper_arm_length") + TALL.size("forearm_length")


def points_at(distance_m: float, scale: float = 1.0, turn_rad: float = 0.0) -> ImagePoints:
    """Return points of arms and hips of TALL, whose space is ``scale`` times as large."""
    upper_m, fore_m, trunk_m = 0.452 * ARM_M, 0.388 * ARM_M, 0.818 * ARM_M
    there = {
        "left_hip": (0.1, trunk_m - 0.1, 0.0),
        "right_hip": (-0.1, trunk_m - 0.1, 0.0),
        "left_wrist": (0.18 + 0.6 * upper_m, -0.1 + 0.8 * upper_m + fore_m, 0.0),
        "left_shoulder": (0.18, -0.1, 0.0),
        "right_shoulder": (-0.18, -0.1, 0.0),
        "left_elbow": (0.18 + 0.6 * upper_m, -0.1 + 0.8 * upper_m, 0.0),
        "right_elbow": (-0.18, -0.1 + 0.6 * upper_m, -0.8 * upper_m),
    }
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    px, spatial_m = np.full((len(POINT_NAMES), 2), np.nan), np.zeros((len(POINT_NAMES), 3))
    scores = np.zeros(len(POINT_NAMES))
    for name, (x, y, z) in there.items():
        turned = np.array([c * x + s * z, y, c * z - s * x])
        px[POINT_INDEX[name]] = CAMERA.project(turned + np.array([0.1, 0.2, distance_m]))
        spatial_m[POINT_INDEX[name]] = scale * turned
        scores[POINT_INDEX[name]] = 1.0
    return ImagePoints(px, scores, spatial_m=spatial_m)


@given(st.floats(0.8, 8.0), st.floats(0.5, 2.0), st.floats(-1.0, 1.0))
def test_the_distance_is_that_of_the_shoulders_whatever_scale_the_points_have(
    distance_m: float, scale: float, turn_rad: float
) -> None:
    found = distance_of_points(points_at(distance_m, scale, turn_rad), TALL, CAMERA)
    assert found == pytest.approx(distance_m)


def test_a_smaller_person_of_the_same_image_is_nearer() -> None:
    child = body_from_proportions(1.35, 2.0)
    found = distance_of_points(points_at(2.0), child, CAMERA)
    assert found == pytest.approx(2.0 * 1.35 / 1.80, rel=1e-3)


def test_points_without_space_or_without_a_shoulder_show_no_distance() -> None:
    points = points_at(2.0)
    assert distance_of_points(replace(points, spatial_m=None), TALL, CAMERA) is None
    scores = points.scores.copy()
    scores[POINT_INDEX["left_shoulder"]] = 0.0
    assert distance_of_points(replace(points, scores=scores), TALL, CAMERA) is None


def estimate_at(distance_m: float, body: BodyModel) -> Estimate:
    keypoints_m = np.tile([0.0, 0.0, distance_m], (6, 1))
    offset_m = np.array([body.placement.distance_m - distance_m, 0.0])
    return Estimate(TRACKING, np.zeros(12), np.zeros(12), keypoints_m, offset_m=offset_m)


def frames(points: ImagePoints | None, depth: bool = False, count: int = 10) -> list[Frame]:
    channels = {"points": points, "depth_m": np.ones((240, 320)) if depth else None}
    channels |= {"silhouette": np.zeros((240, 320), np.uint8)}
    return [Frame(CAMERA, channels, 240, 5000, stamp_ns=number * 10**8) for number in range(count)]


@pytest.mark.parametrize(
    ("body", "depth", "alone", "rests_on", "relative"),
    [
        (BodyModel(), False, True, MEASURED_BODY, 0.02),
        (TALL, False, True, STATURE, 0.05),
        (TALL, True, True, DEPTH, 0.02),
        (TALL, False, False, SECOND_CAMERA, 0.02),
    ],
)
def test_the_deviation_of_the_distance_is_that_of_what_it_rests_on(
    body: BodyModel, depth: bool, alone: bool, rests_on: str, relative: float
) -> None:
    body = body.with_values(pitch_stddev_rad=0.0)
    place = PlaceWatch(body, CAMERA).see(
        estimate_at(4.0, body), body, frames(None, depth)[0], alone
    )
    assert place is not None
    assert place.rests_on == rests_on
    assert place.stddev_m[0] == pytest.approx(4.0 * np.hypot(relative, 0.005))


def test_a_place_is_uncertain_while_a_side_of_the_image_cuts_an_outline() -> None:
    silhouette = np.zeros((240, 320), np.uint8)
    for first, points, depth, state in (
        (0, None, False, KeypointState.UNCERTAIN),
        (280, None, False, KeypointState.UNCERTAIN),
        (140, None, False, KeypointState.TRACKED),
        (0, points_at(2.0), False, KeypointState.TRACKED),
        (0, None, True, KeypointState.TRACKED),
    ):
        seen = silhouette.copy()
        seen[60:200, first : first + 40] = 255
        (frame,) = frames(points, depth, count=1)
        frame = replace(frame, channels={**frame.channels, "silhouette": seen})
        place = PlaceWatch(TALL, CAMERA).see(estimate_at(1.5, TALL), TALL, frame)
        assert place is not None and place.state is state


def test_no_place_is_sure_before_a_camera_that_moves_and_the_shape_stays() -> None:
    silhouette = Renderer(CAMERA, np.random.default_rng(0)).silhouette(MEASURED_BODY_AT_2_M, FRONT)
    shapes = []
    for moves, state in ((False, KeypointState.TRACKED), (True, KeypointState.UNCERTAIN)):
        body = MEASURED_BODY_AT_2_M.with_values(camera_moves=moves)
        tracker = Tracker(body, CAMERA, default_preset(), np.random.default_rng(0))
        found = tracker.track(silhouette)
        assert found.place is not None and found.place.state is state
        shapes.append((found.state, found.reason, found.keypoint_states))
    assert shapes[0] == shapes[1]


def test_an_unsure_pitch_makes_the_distance_unsure_unless_depth_shows_it() -> None:
    body = TALL.with_values(camera_pitch_rad=0.2, pitch_stddev_rad=0.15)
    for depth, relative in ((False, 0.05), (True, 0.02)):
        place = PlaceWatch(body, CAMERA).see(estimate_at(4.0, body), body, frames(None, depth)[0])
        # tan 0.2 is 0.2027; to the second order there are 0.15 / sqrt(2), and 0.2290 of both.
        known, shorter = np.hypot(relative, 0.005), 0.0 if depth else 0.15 * 0.2290
        assert place is not None
        assert place.stddev_m[0] == pytest.approx(4.0 * np.hypot(known, shorter), rel=1e-3)


def test_a_stated_field_of_view_makes_a_far_place_uncertain() -> None:
    stated = replace(CAMERA, focal_stddev=0.03)
    near, far = (
        PlaceWatch(TALL, stated).see(estimate_at(at_m, TALL), TALL, frames(None)[0])
        for at_m in (2.0, 6.0)
    )
    assert near is not None and far is not None
    # 2 m: 0.3 m are 2.6 deviations of 0.117 m; 6 m: 0.86 deviations of 0.35 m.
    assert near.chance == pytest.approx(0.0101, abs=0.001)
    assert far.chance == pytest.approx(0.391, abs=0.005)
    assert (near.state, far.state) == (KeypointState.TRACKED, KeypointState.UNCERTAIN)


def test_no_distance_is_sure_before_a_lens_that_nobody_knows() -> None:
    guessed = replace(CAMERA, focal_stddev=GUESSED_STDDEV)
    near = PlaceWatch(TALL, guessed).see(estimate_at(0.8, TALL), TALL, frames(None)[0])
    # By its deviation alone it would be sure: 0.3 m are 1.8 deviations of 0.17 m.
    assert near is not None and near.chance < PLACE_UNCERTAIN_FROM
    assert near.contradiction == "nothing tells the field of view"


def test_a_distance_that_is_only_guessed_is_uncertain_unless_depth_shows_it() -> None:
    body = replace(TALL, unknown=("distance_m",))
    for depth, state in ((False, KeypointState.UNCERTAIN), (True, KeypointState.TRACKED)):
        place = PlaceWatch(body, CAMERA).see(estimate_at(2.0, body), body, frames(None, depth)[0])
        assert place is not None and place.state is state


@pytest.mark.parametrize(
    ("stature_m", "is_told"), [(1.80, False), (1.62, False), (1.55, True), (2.16, True)]
)
def test_a_stature_that_contradicts_the_given_distance_is_told(
    stature_m: float, is_told: bool
) -> None:
    body = body_from_proportions(stature_m, 2.0)
    watch = PlaceWatch(body, CAMERA)
    for frame in frames(points_at(2.0)):
        place = watch.see(estimate_at(2.0, body), body, frame)
    assert place is not None
    assert bool(place.contradiction) is is_told
    assert watch.is_too_large is (stature_m > 2.0)
    assert place.state is (KeypointState.UNCERTAIN if is_told else KeypointState.TRACKED)
    if is_told:
        shown_m = f"{2.0 * stature_m / 1.80:.1f} m"
        assert shown_m in watch.contradiction and "2.0 m" in watch.contradiction
        # The place is off by what the two sources differ by.
        assert place.stddev_m[0] >= abs(2.0 * stature_m / 1.80 - 2.0)


def test_a_body_that_is_too_large_makes_the_shape_uncertain() -> None:
    tracker = Tracker(TALL.with_values(unknown=()), CAMERA, default_preset())
    shown = render(cardbox_patches(TALL, reference_posture("front")), CAMERA)
    sure = tracker.track(shown)
    tracker.place.is_too_large = True
    doubtful = tracker.track(shown)
    assert KeypointState.TRACKED in sure.keypoint_states
    assert doubtful.state == UNCERTAIN
    assert KeypointState.TRACKED not in doubtful.keypoint_states


@pytest.mark.parametrize("depth", [False, True])
def test_a_stature_that_contradicts_depth_or_a_second_camera_is_told(depth: bool) -> None:
    child = body_from_proportions(1.35)
    for body, is_told in ((child, True), (body_from_proportions(1.80), False)):
        watch = PlaceWatch(body, CAMERA)
        for frame in frames(points_at(2.0), depth):
            watch.see(estimate_at(2.0, body), body, frame, is_alone=depth)
        assert bool(watch.contradiction) is is_told


def test_points_that_err_for_a_moment_contradict_no_later_version_of_a_body() -> None:
    body = body_from_proportions(1.80)
    watch = PlaceWatch(body, CAMERA)
    for frame in (*frames(points_at(2.0)), *frames(points_at(2.4), count=60)[10:]):
        if frame.stamp_ns in (20 * 10**8, 40 * 10**8):
            watch = PlaceWatch(body, CAMERA, watch)
        watch.see(estimate_at(2.0, body), body, frame, is_alone=False)
    assert watch.contradiction == ""
    # A contradiction lasts, too.
    child = body_from_proportions(1.35)
    watch = PlaceWatch(child, CAMERA)
    for frame in frames(points_at(2.0)):
        watch.see(estimate_at(2.0, child), child, frame, is_alone=False)
    assert PlaceWatch(child, CAMERA, watch).contradiction == watch.contradiction != ""


def test_without_a_second_source_nothing_contradicts() -> None:
    child = body_from_proportions(1.35)
    watch = PlaceWatch(child, CAMERA)
    for frame in frames(points_at(2.0)):
        watch.see(estimate_at(2.0, child), child, frame)
    assert watch.contradiction == ""


@pytest.mark.parametrize(
    ("iou", "yaw_rad", "has_points", "is_sure"),
    [
        (0.9, 0.0, False, True),
        (0.8, 0.0, False, False),
        (0.9, 0.6, False, False),
        (0.9, 1.3, False, False),
        (0.9, 3.0, False, True),
        (0.8, 0.0, True, True),
    ],
)
def test_a_change_of_the_distance_counts_if_the_outline_fits_as_usual(
    iou: float, yaw_rad: float, has_points: bool, is_sure: bool
) -> None:
    """Outlines show somebody at 2 m who is then 1 m farther away, and comes back."""
    points = replace(points_at(2.0), spatial_m=None) if has_points else None
    watch, seen = PlaceWatch(TALL, CAMERA), iter(frames(points, count=12))
    for distance_m, overlap, turned_rad, is_tracked, off_m in (
        *[(2.0, 0.9, 0.0, True, 0.1)] * 10,
        (3.0, iou, yaw_rad, is_sure, 0.15 if is_sure else 1.0),
        (2.0, 0.9, 0.0, True, 0.1),
    ):
        found = replace(estimate_at(distance_m, TALL), iou=overlap)
        assert found.posture is not None
        found.posture[YAW] = turned_rad
        place = watch.see(found, TALL, next(seen))
        assert place is not None
        assert (place.state is KeypointState.TRACKED) == is_tracked
        assert place.stddev_m[0] == pytest.approx(off_m, abs=0.02)


@pytest.mark.parametrize(("images", "is_sure"), [(100, False), (130, True)])
def test_an_overlap_is_usual_after_eight_seconds(images: int, is_sure: bool) -> None:
    """At 15 Hz, of the latest ten."""
    watch, frame = PlaceWatch(TALL, CAMERA), frames(None)[0]
    for distance_m, iou in (*[(2.0, 0.9)] * 200, *[(2.0, 0.8)] * images, (3.0, 0.8)):
        place = watch.see(replace(estimate_at(distance_m, TALL), iou=iou), TALL, frame)
    assert place is not None
    assert (place.state is KeypointState.TRACKED) == is_sure


def test_a_place_that_is_wrong_in_one_of_ten_cases_is_uncertain() -> None:
    for chance, state in ((0.07, KeypointState.TRACKED), (0.15, KeypointState.UNCERTAIN)):
        assert Place(np.zeros(3), chance, STATURE).state is state
