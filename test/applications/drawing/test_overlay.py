"""Overlays: the model is drawn where it is, and only if there is one; heads can be hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.applications.drawing.overlay import (
    GAZE_BGR,
    HAND_BGR,
    JOINT_BGR,
    OUTLINE_BGR,
    SKELETON_BGR,
    UNCERTAIN_BGR,
    draw_camera_overlay,
    draw_message,
    draw_model,
    draw_overlay,
    draw_sharp_overlay,
    with_hidden_faces,
    with_hidden_head,
)
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.recordings.markers import marker_shapes
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.estimate import FILLED, NO_PERSON, TRACKING, Estimate, Hand, Legs
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel()
CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)
FRONT = reference_posture("front")
FOUND = Estimate("tracking", FRONT, np.zeros(12), None, 1234, 0.87)
GREY = np.full((240, 320), 90, np.uint8)


def near(canvas: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    return np.abs(canvas.astype(int) - colour).max(axis=2) < 30


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("shape", [(240, 320), (240, 320, 3)])
def test_an_overlay_is_a_colour_image_of_the_asked_size(shape: tuple[int, ...], scale: int) -> None:
    image = np.full(shape, 90, np.uint8)
    overlay = draw_overlay(image, BODY, CAMERA, FOUND, scale)
    assert overlay.shape == (240 * scale, 320 * scale, 3)
    assert overlay.dtype == np.uint8
    assert near(overlay, OUTLINE_BGR).any()
    assert near(overlay, SKELETON_BGR).any()
    assert np.all(image == 90)


@pytest.mark.parametrize("scale", [1, 3])
def test_the_skeleton_is_where_the_joints_are(scale: int) -> None:
    overlay = draw_overlay(GREY, BODY, CAMERA, FOUND, scale)
    view = CAMERA.scaled(320 * scale, 240 * scale)
    pixels = view.project(view.reference_to_optical(pose(BODY.rigid, FRONT).keypoints_m))
    for u, v in pixels.round().astype(int):
        assert near(overlay, JOINT_BGR)[v, u]


def test_an_open_hand_is_a_ring_and_a_closed_one_a_disc() -> None:
    keypoints = np.tile([0.0, 0.0, 2.0], (6, 1))
    # In the upper corners, where nothing of the person is drawn.
    keypoints[[2, 5], :2] = [(1.0, -0.5), (-1.0, -0.5)]
    hand = Hand(0.9, np.array([0.0, 0.0, -1.0]), np.zeros(3), np.ones(3))
    hands = hand, hand._replace(open=0.1)
    overlay = draw_overlay(GREY, BODY, CAMERA, replace(FOUND, keypoints_m=keypoints, hands=hands))
    (left, top), (right, _) = CAMERA.project(keypoints[[2, 5]]).round().astype(int)
    assert not near(overlay, HAND_BGR)[top, left] and near(overlay, HAND_BGR)[top, left + 6]
    assert near(overlay, HAND_BGR)[top, right]
    some = draw_overlay(
        GREY, BODY, CAMERA, replace(FOUND, keypoints_m=keypoints, hands=(hands[1], None))
    )
    assert near(some, HAND_BGR)[top, left] and not near(some, HAND_BGR)[top, right]


def test_legs_are_drawn_by_their_states() -> None:
    points_m = np.array([(s, y, 2.0) for s in (0.9, -0.9) for y in (-0.6, -0.2, 0.2)])
    states = (KeypointState.TRACKED,) * 5 + (KeypointState.UNCERTAIN,)
    legs = Legs(np.zeros(8), np.zeros(8), points_m, np.zeros(6), states)
    overlay = draw_overlay(GREY, BODY, CAMERA, replace(FOUND, legs=legs))
    for joint, colour in ((1, SKELETON_BGR), (2, SKELETON_BGR), (5, (0, 230, 255))):
        u, v = CAMERA.project((points_m[joint - 1] + points_m[joint]) / 2).round().astype(int)
        assert near(overlay, colour)[v, u]
    behind = legs._replace(points_m=-points_m)
    hidden = draw_overlay(GREY, BODY, CAMERA, replace(FOUND, legs=behind))
    assert (hidden == draw_overlay(GREY, BODY, CAMERA, FOUND)).all()


def test_the_person_is_drawn_where_the_estimate_is() -> None:
    """0.4 m nearer and 0.1 m lower: larger, and the joints where they project to."""
    moved = replace(FOUND, offset_m=np.array([0.4, -0.1]))
    overlay = draw_overlay(GREY, BODY, CAMERA, moved)
    body = BODY.with_values(distance_m=1.6, hip_height_m=-0.6)
    pixels = CAMERA.project(CAMERA.reference_to_optical(pose(body.rigid, FRONT).keypoints_m))
    for u, v in pixels.round().astype(int):
        assert near(overlay, JOINT_BGR)[v, u]
    assert np.any(overlay != draw_overlay(GREY, BODY, CAMERA, FOUND))


@pytest.mark.parametrize("body", [BODY, BODY.rigid], ids=["default", "paper"])
def test_raised_arms_are_drawn_where_the_filter_has_them(body: BodyModel) -> None:
    state = np.zeros(14)
    state[[4, 8]] = 2.0
    points_m = WholeBodyCost(body, CAMERA, WholeBodyCostConfig()).keypoints(state)
    raised = replace(FOUND, posture=state[:12], keypoints_m=points_m)
    overlay = draw_overlay(GREY, body, CAMERA, raised, 3)
    view = CAMERA.scaled(960, 720)
    for u, v in view.project(points_m).round().astype(int):
        assert near(overlay, JOINT_BGR)[v, u]
    skeleton = marker_shapes(body, state[:12])[1].points_m
    for point in points_m:
        assert np.linalg.norm(skeleton - point, axis=1).min() < 1e-9


@pytest.mark.parametrize(("width", "expected"), [(320, 640), (500, 1000), (640, 640), (800, 800)])
def test_live_overlays_of_small_images_are_enlarged(width: int, expected: int) -> None:
    """At 320 px letters are 8 px high and blur when the window enlarges them."""
    grey = np.full((width * 3 // 4, width), 90, np.uint8)
    camera = CAMERA.scaled(width, width * 3 // 4)
    overlay = draw_camera_overlay(grey, 0, FOUND, Tracker(BODY, camera))
    assert overlay.shape == (expected * 3 // 4, expected, 3)
    view = camera.scaled(expected, expected * 3 // 4)
    pixels = view.project(view.reference_to_optical(pose(BODY.rigid, FRONT).keypoints_m))
    for u, v in pixels.round().astype(int):
        assert near(overlay, JOINT_BGR)[v, u]
    assert draw_message(grey, "waiting for a body model").shape == overlay.shape


def test_what_may_be_wrong_is_amber() -> None:
    overlay = draw_overlay(GREY, BODY, CAMERA, replace(FOUND, state="uncertain"))
    assert near(overlay, UNCERTAIN_BGR)[:40].any(), "the text"
    assert near(overlay, UNCERTAIN_BGR)[80:].sum() > 100, "the outline"
    assert not near(overlay, OUTLINE_BGR).any()
    sure = draw_overlay(GREY, BODY, CAMERA, FOUND)
    assert not near(sure, UNCERTAIN_BGR)[:40].any()


def test_a_filled_gap_is_amber_and_has_no_fit() -> None:
    filled = replace(FOUND, state=FILLED, cost_px=None, iou=None)
    overlay = draw_overlay(GREY, BODY, CAMERA, filled, 1)
    assert near(overlay, UNCERTAIN_BGR).any() and not near(overlay, OUTLINE_BGR).any()


def test_the_outline_frames_the_head_and_nothing_far_from_it() -> None:
    canvas = np.zeros((240, 320, 3), np.uint8)
    draw_model(canvas, BODY, CAMERA, FRONT)
    rows, columns = np.nonzero(near(canvas, OUTLINE_BGR))
    # The crown is 0.33 m above the camera at 1.96 m: 250 x 0.33 / 1.96 = 42 px above the middle.
    assert rows.min() == pytest.approx(119.5 - 42.1, abs=2)
    # The hands reach 0.18 + 0.63 sin 20 = 0.395 m to either side: 49 px, and half a wrist.
    assert columns.min() == pytest.approx(159.5 - 49.4 - 5, abs=3)
    assert columns.max() == pytest.approx(159.5 + 49.4 + 5, abs=3)
    assert not canvas[:, :90].any()
    assert not canvas[:70].any()


@pytest.mark.parametrize("state", ["no_person", "lost"])
def test_without_a_posture_there_is_only_text(state: str) -> None:
    overlay = draw_overlay(GREY, BODY, CAMERA, Estimate(state))
    assert np.all(overlay[40:] == 90)
    assert np.any(overlay[:40] != 90)
    assert not near(overlay, OUTLINE_BGR).any()


def test_the_text_tells_the_state() -> None:
    overlays = [draw_overlay(GREY, BODY, CAMERA, Estimate(s)) for s in ("lost", "no_person")]
    assert np.any(overlays[0] != overlays[1])


def test_a_person_behind_the_camera_is_not_drawn() -> None:
    canvas = np.zeros((240, 320, 3), np.uint8)
    draw_model(canvas, BODY, CAMERA.with_pitch(np.pi), FRONT)
    assert not canvas.any()


def test_a_person_half_outside_does_not_fail() -> None:
    aside = FRONT.copy()
    aside[0] = 1.3
    canvas = np.zeros((240, 320, 3), np.uint8)
    draw_model(canvas, BODY, CAMERA, aside)
    assert canvas[:, 250:].any()
    assert not canvas[:, :200].any()


@pytest.mark.parametrize(("yaw_rad", "side"), [(0.8, 1), (-0.8, -1)])
def test_the_gaze_points_where_the_face_looks(yaw_rad: float, side: int) -> None:
    """To the person's left is to the right of the image; without a neck there is no line."""
    seen = draw_overlay(GREY, BODY, CAMERA, replace(FOUND, neck=np.array([yaw_rad, 0.0])))
    columns = np.nonzero(near(seen, GAZE_BGR))[1]
    u, _ = CAMERA.project(CAMERA.reference_to_optical(pose(BODY.rigid, FRONT).head))
    far = columns[np.argmax(np.abs(columns - u))]
    assert side * (far - u) > 10
    assert not near(draw_overlay(GREY, BODY, CAMERA, FOUND), GAZE_BGR).any()


def test_bones_to_uncertain_hands_are_yellow_lost_ones_red_and_hidden_ones_dashed() -> None:
    camera = CAMERA.scaled(960, 720)
    grey = np.full((720, 960), 90, np.uint8)
    elbow, hand = camera.project(camera.reference_to_optical(pose(BODY.rigid, FRONT).keypoints_m))[
        [1, 2]
    ]
    along = elbow + np.linspace(0.15, 0.85, 60)[:, None] * (hand - elbow)
    columns, rows = along.round().astype(int).T
    expected = {
        KeypointState.TRACKED: (SKELETON_BGR, 1.0, 1.0),
        KeypointState.UNCERTAIN: ((0, 230, 255), 1.0, 1.0),
        KeypointState.LOST: ((60, 60, 255), 1.0, 1.0),
        KeypointState.HIDDEN: ((200, 200, 200), 0.3, 0.8),
    }
    for state, (colour, least, most) in expected.items():
        states = tuple(state if i == 2 else KeypointState.TRACKED for i in range(6))
        overlay = draw_overlay(grey, BODY, camera, replace(FOUND, keypoint_states=states))
        assert least <= near(overlay, colour)[rows, columns].mean() <= most


AVERAGE = body_from_proportions(1.75, 2.0)
NEAR = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
# Every pixel differs from its neighbours.
NOISE = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)


def hidden_by(estimate: Estimate) -> np.ndarray:
    """Return which pixels (H, W) of noise were changed."""
    drawn = with_hidden_head(NOISE, AVERAGE, NEAR, estimate)
    assert drawn.shape == NOISE.shape
    return np.asarray((drawn != NOISE).any(axis=2))


def head_px(posture: np.ndarray) -> np.ndarray:
    """Return the pixels (n, 2) of the corners of the model's head."""
    patches = cardbox_patches(AVERAGE, posture)[[PATCH_NAMES.index("head_frontal")]]
    return NEAR.project(NEAR.reference_to_optical(patches)).reshape(-1, 2)


@pytest.mark.parametrize("pitch_rad", [0.0, 0.6])
def test_the_head_becomes_coarse(pitch_rad: float) -> None:
    posture = np.zeros(12)
    posture[2] = pitch_rad
    changed = hidden_by(Estimate(TRACKING, posture))
    (left, top), (right, bottom) = head_px(posture).min(axis=0), head_px(posture).max(axis=0)
    inside = changed[max(0, int(top)) : int(bottom), int(left) : int(right)]
    assert inside.mean() > 0.95
    assert not changed[200:].any()
    assert changed.mean() < 0.25


def test_heads_are_hidden_below_the_model_of_whoever_is_there() -> None:
    there = Estimate(TRACKING, np.zeros(12), iou=0.9, cost_px=1)
    drawn = draw_overlay(NOISE, AVERAGE, NEAR, there, hides_heads=True)
    expected = with_hidden_head(NOISE, AVERAGE, NEAR, there)
    assert (drawn == draw_overlay(expected, AVERAGE, NEAR, there)).all()
    assert (drawn != draw_overlay(NOISE, AVERAGE, NEAR, there)).any()
    # Nobody knows where a lost head is; one of several people who is not there has none.
    lost = draw_overlay(NOISE, AVERAGE, NEAR, Estimate("lost"), hides_heads=True)
    assert (lost != NOISE).any(axis=2).mean() > 0.9
    away = draw_overlay(NOISE, AVERAGE, NEAR, Estimate("no_person", person=2), hides_heads=True)
    assert (away != NOISE).any(axis=2).mean() < 0.1


def test_few_colours_remain() -> None:
    drawn = with_hidden_head(NOISE, AVERAGE, NEAR, Estimate(TRACKING, np.zeros(12)))
    changed = (drawn != NOISE).any(axis=2)
    assert len(np.unique(drawn[changed], axis=0)) <= 60
    assert (np.random.default_rng(0).integers(0, 256, NOISE.shape, np.uint8) == NOISE).all()


def face_at(column: float) -> ImagePoints:
    known = {"nose": (column, 40, 0.9), "left_shoulder": (column + 15, 70, 0.9)}
    return ImagePoints.of({**known, "right_shoulder": (column - 15, 70, 0.9)})


def test_all_faces_that_a_detector_shows_are_hidden_at_any_size() -> None:
    large = NOISE.repeat(2, axis=0).repeat(2, axis=1)
    drawn = with_hidden_faces(large, NEAR, [face_at(60.0), face_at(290.0), ImagePoints.of({})])
    changed = (drawn != large).any(axis=2)
    for column in (60, 290):
        head = changed[2 * 28 : 2 * 52, 2 * (column - 12) : 2 * (column + 12)]
        assert head.mean() > 0.95
    assert changed.mean() < 0.05


def test_sharp_pictures_of_bags_have_no_face_of_anybody() -> None:
    tracker = Tracker(AVERAGE, NEAR)
    frame = RecordedFrame(0, 0.0, NOISE, NOISE[..., 0], people=(face_at(290.0),))
    estimate = Estimate(TRACKING, np.zeros(12), iou=0.9, cost_px=1)
    shown, hidden = (draw_sharp_overlay(frame, estimate, tracker, hides) for hides in (False, True))
    there = np.s_[2 * 30 : 2 * 50, 2 * 280 : 2 * 300]
    assert (shown[there] != hidden[there]).any(axis=2).mean() > 0.95


def test_an_unknown_head_hides_everything() -> None:
    assert hidden_by(Estimate(NO_PERSON)).mean() > 0.95
