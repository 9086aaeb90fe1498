"""Where a further camera stands, found from a person; and the doubt about wrong extrinsics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring import camera_guess, camera_pose
from cardbox_tracker.measuring.camera_guess import guessed_extrinsics, reference_states
from cardbox_tracker.measuring.camera_pose import (
    ROTATION,
    PoseProblem,
    Sighting,
    moved_by,
    turned_by,
)
from cardbox_tracker.measuring.silhouette_tangents import PoseDirection, TopTangents, roll_of
from cardbox_tracker.person.model import PROPORTIONS, BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.term import Frame, Silhouette
from cardbox_tracker.tracking import camera_calibration
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.camera_calibration import MovingFrame, calibrated_camera
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(hip_height_m=-0.51)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
OTHER = Camera(320, 240, 310.0, 310.0, 150.0, 124.0)


def aside(angle_rad: float = 1.0) -> Extrinsics:
    """A camera as far from the person as the first one, round to their left."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    centre = np.array([0.0, 0.0, 2.0]) + 2.0 * turn.T @ [0.0, -0.05, -1.0]
    return Extrinsics(turn, -turn @ centre)


TRUE = aside()


@pytest.fixture
def one_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """For tests of what does not depend on how exactly the turn of a camera is estimated."""
    monkeypatch.setattr(camera_pose, "ENDS", (1, 0.0))


def sightings(
    states: list[np.ndarray], body: BodyModel = BODY, pose: Extrinsics = TRUE
) -> list[Sighting]:
    """A round person, who is not the model, as both cameras see them."""
    view = View.of(body, CAMERA, OtherCamera(OTHER, pose))
    rng = np.random.default_rng(0)
    first, other = Renderer(CAMERA, rng), Renderer(view.camera, rng)
    found = []
    for state in states:
        there = view.states(state)
        x_m, z_m = there[12:].tolist()
        place = view.body.placement
        seen = view.body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )
        found.append(
            Sighting(state, first.silhouette(body, state[:12]), other.silhouette(seen, there[:12]))
        )
    return found


def waving(count: int, every_s: float = 0.5) -> list[np.ndarray]:
    return [np.append(wave(1.0 + i * every_s), [0.0, 0.0]) for i in range(count)]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_turn_of_the_camera_is_found(axis: int) -> None:
    change = np.zeros(6)
    change[axis] = np.radians(3.0)
    wrong = moved_by(TRUE, change)
    np.testing.assert_allclose(turned_by(TRUE, wrong), change[:3], atol=1e-9)
    found, _ = PoseProblem(BODY, CAMERA, OTHER, wrong, sightings(waving(6))).solve(ROTATION)
    left = np.degrees(turned_by(TRUE, found))
    assert abs(left[axis]) < 1.5
    assert np.linalg.norm(left[:2]) < 1.8


def tangents_of(frames: list[Sighting]) -> TopTangents:
    return TopTangents(CAMERA, OTHER, [(one.first, one.other) for one in frames])


def test_planes_through_both_cameras_touch_both_silhouettes() -> None:
    tangents = tangents_of(sightings(waving(8)))
    assert np.abs(tangents.heights(TRUE)).max() < 0.5
    up, roll = (
        tangents.heights(moved_by(TRUE, np.radians(3.0) * axis)) for axis in np.eye(6)[[0, 2]]
    )
    assert up.min() > 12.0
    # A raised hand beside the head tells a roll from that.
    assert np.ptp(roll) > 3.0


def test_a_silhouette_that_is_cut_off_says_nothing() -> None:
    (frame,) = sightings(waving(1))
    cut = frame.other.copy()
    cut[:80] = cut[100]
    tangents = tangents_of([frame, Sighting(frame.state, frame.first, cut)])
    assert np.isfinite(tangents.heights(TRUE)).tolist() == [True, False]
    nobody = np.zeros_like(cut)
    assert tangents_of([Sighting(frame.state, frame.first, nobody)]).heights(TRUE).size == 0


@pytest.mark.parametrize(("row", "is_whole"), [(3, False), (5, True)])
def test_a_top_within_four_pixels_of_the_border_may_be_cut_off(row: int, is_whole: bool) -> None:
    (frame,) = sightings([np.append(reference_posture("front"), [0.0, 0.0])])
    top = int(np.flatnonzero(frame.other.any(axis=1))[0])
    higher = np.roll(frame.other, row - top, axis=0)
    tangents = tangents_of([Sighting(frame.state, frame.first, higher)])
    assert np.isfinite(tangents.heights(TRUE)).all() == is_whole


def test_with_tangents_a_roll_is_found() -> None:
    wrong = moved_by(TRUE, np.array([0.0, 0.0, np.radians(4.0), 0.0, 0.0, 0.0]))
    frames = sightings(waving(8))
    found, _ = PoseProblem(BODY, CAMERA, OTHER, wrong, frames, tangents_of(frames)).solve()
    assert abs(np.degrees(turned_by(TRUE, found))[2]) < 2.0


@pytest.mark.parametrize("degrees", [0.0, 3.0, -2.0])
def test_a_roll_is_told_from_a_turn_up_by_heights_at_several_places(degrees: float) -> None:
    roll_rad = np.radians(degrees)
    change = np.array([np.radians(1.0), 0.0, -roll_rad, 0.0, 0.0, 0.0])
    frames = sightings([*waving(10), *(s + 0.3 * np.eye(14)[0] for s in waving(4))])
    found, stddev = roll_of(tangents_of(frames), moved_by(TRUE, change))
    assert found == pytest.approx(roll_rad, abs=0.012)
    assert 0.0 < stddev < 0.02


def test_of_somebody_who_stands_still_no_roll_is_known() -> None:
    for count in (3, 30):
        frames = sightings([np.append(reference_posture("front"), [0.0, 0.0])] * count)
        assert roll_of(tangents_of(frames), TRUE)[1] == np.inf
    assert roll_of(TopTangents(CAMERA, OTHER), TRUE)[1] == np.inf


def test_only_the_latest_silhouettes_count() -> None:
    frames = sightings(waving(5))
    latest = TopTangents(CAMERA, OTHER, [(one.first, one.other) for one in frames], most=2)
    now = latest.copy()
    latest.add(frames[0].first, frames[0].other)
    np.testing.assert_array_equal(now.heights(TRUE), tangents_of(frames[3:]).heights(TRUE))
    last = tangents_of([frames[4], frames[0]]).heights(TRUE)
    np.testing.assert_array_equal(latest.heights(TRUE), last)


def framed(*silhouettes: Silhouette) -> list[Frame]:
    return [Frame(CAMERA, {"silhouette": one}, CAMERA.height, 1) for one in silhouettes]


def agreement(extrinsics: Extrinsics, count: int, body: BodyModel = BODY) -> CameraAgreement:
    view = View.of(body, CAMERA, OtherCamera(OTHER, extrinsics))
    asked = CameraAgreement(body, CAMERA, [view])
    frames = sightings(waving(count))
    for frame in frames:
        for _ in range(12):
            shown = framed(frame.first, view.upright(frame.other, is_mask=True))
            asked.look(shown)
            asked.see(frame.state, shown)
    return asked


def test_wrong_extrinsics_are_told_and_right_ones_are_not() -> None:
    right = agreement(TRUE, 15)
    assert right.is_due
    right.check()
    assert not right.is_due
    assert right.remarks(["cam1"]) == []
    wrong = agreement(moved_by(TRUE, np.array([np.radians(4.0), *[0.0] * 5])), 15)
    wrong.check()
    (text,) = wrong.remarks(["cam1"])
    assert "cam1" in text
    assert "degrees" in text
    assert right.turned_deg[0] is not None
    assert wrong.turned_deg[0] is not None
    assert wrong.turned_deg[0] > right.turned_deg[0] + 1.0


def test_wrong_sizes_of_a_person_by_stature_are_no_wrong_extrinsics(one_step: None) -> None:
    larger = BODY.with_values(sizes=1.1 * BODY.sizes)
    measured, guessed = larger, larger.with_values(source=PROPORTIONS)
    said = []
    for body in (measured, guessed):
        right = agreement(TRUE, 15, body)
        right.check()
        said.append(right.remarks(["cam1"]))
        # The wrong sizes turn the estimate beyond the bound of measured people.
        assert right.turned_deg[0] is not None
        assert 0.85 < right.turned_deg[0] < 6.0
    assert len(said[0]) == 1
    assert said[1] == []


def test_a_wrong_height_is_told_of_a_person_by_stature(one_step: None) -> None:
    """The heights of head and hands need no sizes."""
    guessed = BODY.with_values(sizes=1.1 * BODY.sizes, source=PROPORTIONS)
    up = np.array([np.radians(2.0), *[0.0] * 5])
    wrong = agreement(moved_by(TRUE, up), 15, guessed)
    wrong.check()
    (text,) = wrong.remarks(["cam1"])
    assert "2.0 degrees in height" in text


def test_a_camera_that_is_turned_about_its_own_axis_is_told(one_step: None) -> None:
    rolled = agreement(moved_by(TRUE, np.array([0.0, 0.0, np.radians(3.0), 0.0, 0.0, 0.0])), 15)
    rolled.check()
    assert rolled.rolled_deg[0] == pytest.approx(-3.0, abs=0.8)
    assert any("about its own axis" in text for text in rolled.remarks(["cam1"]))


def test_nothing_is_said_of_a_camera_before_a_window_of_frames(one_step: None) -> None:
    asked = agreement(TRUE, 5)
    assert not asked.is_due
    asked.check()
    asked.check(is_last=True)
    assert asked.turned_deg == [None]
    short = agreement(TRUE, 8)
    short.check()
    assert short.turned_deg == [None]
    short.check(is_last=True)
    assert short.turned_deg != [None]
    # One that never sees the person is not waited for.
    full = np.full((240, 320), 255, np.uint8)
    asked.see(waving(1)[0], framed(full, np.zeros_like(full)))
    assert not asked.is_due


def test_a_camera_is_checked_again_after_48_seconds(one_step: None) -> None:
    asked = agreement(TRUE, 15)
    asked.check()
    shown = framed(*[np.full((240, 320), 255, np.uint8)] * 2)
    frames = 0
    while not asked.is_due:
        asked.see(waving(1)[0], shown)
        frames += 1
    assert frames == 48 * 15


@pytest.mark.parametrize(("between_deg", "is_told"), [(7.0, True), (14.0, False)])
def test_a_wrong_height_is_a_gross_error_of_a_narrow_pair_before_it_is_one_of_others(
    between_deg: float, is_told: bool
) -> None:
    pose = aside(np.radians(between_deg))
    wrong = moved_by(pose, np.radians([0.9, *[0.0] * 5]))
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, wrong))
    asked = CameraAgreement(BODY, CAMERA, [view])
    for frame in sightings(waving(12), pose=pose):
        asked.look(framed(frame.first, view.upright(frame.other, is_mask=True)))
    assert asked.are_contradicted == [is_told]


def test_frames_in_which_others_hide_pixels_do_not_count() -> None:
    full = np.full((240, 320), 255, np.uint8)
    hidden = [one.changed(channels={**one.channels, "covered": full}) for one in framed(full, full)]
    asked = agreement(TRUE, 1)
    before = asked._frames
    assert not asked.look(hidden)
    asked.see(waving(1)[0], hidden)
    assert asked._frames == before


def test_extrinsics_are_found_without_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    # Less of everything than a recording deserves.
    monkeypatch.setattr(camera_calibration, "_PASSES", 1)
    monkeypatch.setattr(camera_calibration, "_SIGHTINGS", 8)
    monkeypatch.setattr(camera_pose, "ENDS", (4, 0.0))
    monkeypatch.setattr(camera_guess, "_BEST", 2)
    states = reference_states(BODY, "left")
    seen = sightings(list(states.values()))
    references = {name: (one.first, one.other) for name, one in zip(states, seen, strict=True)}
    guess = guessed_extrinsics(BODY, CAMERA, OTHER, references)
    angle_rad, away_m = guess.difference(TRUE)
    assert np.degrees(angle_rad) < 10.0
    assert away_m < 0.4
    moving = [
        MovingFrame((one.first, one.other), (None, None)) for one in sightings(waving(16, 0.1))
    ]

    def guessed(*given: object) -> Extrinsics:
        assert given == (BODY, CAMERA, OTHER, references, "left")
        return guess

    monkeypatch.setattr(camera_pose, "ENDS", (2, 0.0))
    monkeypatch.setattr(camera_calibration, "guessed_extrinsics", guessed)
    found = calibrated_camera(BODY, (CAMERA, OTHER), references, moving)
    angle_rad, away_m = found.extrinsics.difference(TRUE)
    assert np.degrees(angle_rad) < 6.0
    assert away_m < 0.25
    assert found.halves_deg < 10.0
    assert "degrees" in str(found)
    with pytest.raises(InitializationError, match="ten seconds"):
        calibrated_camera(BODY, (CAMERA, OTHER), references, moving[:3])


def test_no_pose_is_guessed_where_nobody_is_seen() -> None:
    nobody = np.zeros((240, 320), np.uint8)
    references = dict.fromkeys(("front", "side", "arms"), (nobody, nobody))
    with pytest.raises(InitializationError, match="do not show the person"):
        guessed_extrinsics(BODY, CAMERA, OTHER, references)


TURNED_UP = Extrinsics(
    np.array([(1.0, 0.0, 0.0), (0.0, 0.996195, -0.087156), (0.0, 0.087156, 0.996195)]), np.zeros(3)
)


def judged(extrinsics: Extrinsics, is_exchanged: bool = False) -> PoseDirection:
    cameras = (OTHER, CAMERA) if is_exchanged else (CAMERA, OTHER)
    found = PoseDirection(*cameras, extrinsics, 0.0)
    for frame in sightings(waving(12)):
        pair = (frame.other, frame.first) if is_exchanged else (frame.first, frame.other)
        found.see(*pair)
    return found


def told(found: PoseDirection) -> str | None:
    return None if found.fault is None else found.fault.watch.name


def turned_up(pose: Extrinsics) -> Extrinsics:
    """The pose with a further camera that is said to look 5 degrees higher or lower."""
    return Extrinsics(TURNED_UP.rotation @ pose.rotation, TURNED_UP.rotation @ pose.translation_m)


@pytest.mark.parametrize(
    ("extrinsics", "is_exchanged", "fault"),
    [
        (TRUE, False, None),
        (TRUE.inverse(), False, "inverted"),
        (TRUE, True, "inverted"),
        (TRUE.inverse(), True, None),
        (turned_up(TRUE), False, "contradicted"),
    ],
)
def test_the_direction_of_a_pose_is_judged(
    extrinsics: Extrinsics, is_exchanged: bool, fault: str | None
) -> None:
    found = judged(extrinsics, is_exchanged)
    assert told(found) == fault
    if fault == "contradicted":
        assert found.height.value == pytest.approx(5.0, abs=0.7)


@pytest.mark.parametrize("camera", [0, 1])
@pytest.mark.parametrize(
    ("flip", "fault"), [(np.s_[:, ::-1], "mirrored"), (np.s_[::-1, ::-1], "upside down")]
)
def test_flipped_images_of_either_camera_are_told(camera: int, flip: Any, fault: str) -> None:
    found = PoseDirection(CAMERA, OTHER, TRUE, 0.0)
    for frame in sightings(waving(12)):
        pair = [frame.first, frame.other]
        pair[camera] = np.ascontiguousarray(pair[camera][flip])
        found.see(*pair)
    assert told(found) == fault


def test_a_mirrored_camera_is_told_if_it_is_also_turned_about_its_axis() -> None:
    """Its images are mirrored first, and then turned upright by the roll of its pose."""
    rolled = moved_by(TRUE, np.radians([0.0, 0.0, 5.0, 0.0, 0.0, 0.0]))
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, rolled))
    asked, right = (CameraAgreement(BODY, CAMERA, [view]) for _ in range(2))
    for frame in sightings(waving(12), pose=rolled):
        sharp = {"dsize": (320, 240), "flags": cv2.INTER_NEAREST}
        raw = np.asarray(cv2.warpAffine(frame.other, view.raw_px, **sharp), np.uint8)
        for one, seen in ((right, raw), (asked, np.ascontiguousarray(raw[:, ::-1]))):
            one.look(framed(frame.first, view.upright(seen, is_mask=True)))
    assert [one.direction.fault for one in right._others] == [None]
    (fault,) = (one.direction.fault for one in asked._others)
    assert fault is not None and fault.watch.name == "mirrored"
    assert fault.medians[1] < 0.1


@pytest.mark.parametrize("turned_deg", [0.0, 4.0])
def test_the_first_image_of_a_wrong_pose_is_doubted_before_anything_is_told(
    turned_deg: float,
) -> None:
    wrong = moved_by(TRUE, np.radians([turned_deg, *[0.0] * 5]))
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, wrong))
    asked, frame = CameraAgreement(BODY, CAMERA, [view]), sightings(waving(1))[0]
    asked.look(framed(frame.first, view.upright(frame.other, is_mask=True)))
    assert asked.are_doubtful == [turned_deg > 0.0]
    assert asked.remarks(["cam1"]) == []


def joints_in_both() -> tuple[ImagePoints, ImagePoints]:
    """Joints of somebody two metres away, from 0.6 m below the camera to 0.3 m above it."""
    places = np.random.default_rng(0).uniform((-0.4, -0.3, 1.8), (0.4, 0.6, 2.2), (17, 3))
    there = places @ TRUE.rotation.T + TRUE.translation_m
    seen = ((CAMERA, places), (OTHER, there))
    first, other = (ImagePoints(camera.project(at), np.ones(17)) for camera, at in seen)
    return first, other


@pytest.mark.parametrize("turned_deg", [0.0, -2.0])
def test_a_thing_above_the_head_in_a_mask_is_no_wrong_pose_if_joints_agree(
    turned_deg: float,
) -> None:
    wrong = moved_by(TRUE, np.radians([turned_deg, *[0.0] * 5]))
    alone, found = (PoseDirection(CAMERA, OTHER, wrong, 0.0) for _ in range(2))
    for frame in sightings(waving(12)):
        # The hat is 2.2 degrees high.
        hat = cv2.dilate(frame.other, np.ones((13, 1), np.uint8), anchor=(0, 0))
        alone.see(frame.first, hat)
        found.see(frame.first, hat, joints_in_both())
    assert alone.height.holds and found.height.holds == (turned_deg != 0.0)


@pytest.mark.parametrize(
    ("turned_deg", "zoom", "height_deg"), [(0.0, 1.0, 0.0), (2.0, 1.0, 2.3), (0.0, 1.3, 2.3)]
)
def test_joints_in_both_images_tell_a_wrong_pose_or_focal_length(
    turned_deg: float, zoom: float, height_deg: float
) -> None:
    """The planes through the baseline, at 60 degrees to the line of sight, turn by 2 / sin(60)."""
    wrong = moved_by(TRUE, np.radians([turned_deg, 0.0, 0.0, 0.0, 0.0, 0.0]))
    other = replace(OTHER, fx=zoom * OTHER.fx, fy=zoom * OTHER.fy)
    found, nobody = PoseDirection(CAMERA, other, wrong, 0.0), np.zeros((240, 320), np.uint8)
    for _ in range(6):
        assert not found.joints.holds
        found.see(nobody, nobody, joints_in_both())
    assert found.joints.value == pytest.approx(height_deg, abs=0.2)
    assert found.joints.holds == (height_deg > 0.0)


@pytest.mark.parametrize(("known", "is_told"), [(3, False), (5, True)])
def test_four_joints_in_both_images_tell_a_pose(known: int, is_told: bool) -> None:
    one, other = joints_in_both()
    one = replace(one, scores=1.0 * (np.arange(17) < known))
    apart_deg = PoseDirection(CAMERA, OTHER, TRUE, 0.0).joints_deg(one, other)
    assert (apart_deg is not None) == is_told


def test_a_few_frames_and_empty_images_say_nothing() -> None:
    found = PoseDirection(CAMERA, OTHER, TRUE.inverse(), 0.0)
    (frame,) = sightings(waving(1))
    for _ in range(10):
        found.see(frame.first, np.zeros_like(frame.other))
        found.see(np.full_like(frame.first, 255), frame.other)
    assert found.fault is None
    for _ in range(2 * 5):
        found.see(frame.first, frame.other)
    assert found.fault is None
    found.see(frame.first, frame.other)
    found.see(frame.first, frame.other)
    assert told(found) == "inverted"


def test_a_pose_that_was_put_right_is_trusted_again() -> None:
    found = PoseDirection(CAMERA, OTHER, TRUE, 0.0)
    frames = sightings(waving(4))
    for _ in range(6):
        for frame in frames:
            lower = np.zeros_like(frame.other)
            lower[40:] = frame.other[:-40]
            found.see(frame.first, lower)
    assert told(found) == "contradicted"
    for _ in range(30):
        for frame in frames:
            found.see(frame.first, frame.other)
    assert found.fault is None


def looked(extrinsics: Extrinsics) -> CameraAgreement:
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, extrinsics))
    asked = CameraAgreement(BODY, CAMERA, [view])
    for frame in sightings(waving(12)):
        assert asked.look(framed(frame.first, view.upright(frame.other, is_mask=True)))
    return asked


def test_an_inverted_pose_is_told_once_and_a_right_one_is_not() -> None:
    right, wrong = looked(TRUE), looked(TRUE.inverse())
    assert right.are_contradicted == [False]
    assert right.remarks(["cam1"]) == []
    assert wrong.are_contradicted == [True]
    (text,) = wrong.remarks(["cam1"])
    assert "cam1 seem to be inverted, or the images of the two cameras exchanged" in text
    view = View.of(BODY, CAMERA, OtherCamera(OTHER, TRUE.inverse()))
    assert CameraAgreement(BODY, CAMERA, [view], wrong).are_contradicted == [True]
    (text,) = looked(turned_up(TRUE)).remarks(["cam1"])
    assert "contradict" in text
    assert "degrees in height" in text


def followed(
    frames: list[Sighting], cameras: tuple[Camera, Camera], given: Extrinsics, seed: int = 0
) -> list[Estimate]:
    """Results from the twelfth frame on, since a verdict takes that many."""
    rng, others = np.random.default_rng(seed), [OtherCamera(cameras[1], given)]
    tracker = Tracker(BODY, cameras[0], default_preset(), rng, others=others)
    pairs = [[Observation(frame.first), Observation(frame.other)] for frame in frames]
    return [tracker.track(pair) for pair in pairs][12:]


@pytest.mark.parametrize("turned_deg", [0.0, 2.0])
def test_nobody_is_sure_of_whom_one_camera_shows_higher(turned_deg: float) -> None:
    wrong = moved_by(TRUE, np.radians([turned_deg, 0.0, 0.0, 0.0, 0.0, 0.0]))
    found = followed(sightings(waving(24, 1.0 / 15.0)), (CAMERA, OTHER), wrong)
    is_right = turned_deg == 0.0
    assert any(one.state == TRACKING for one in found) == is_right
    for one in found:
        assert one.place is not None
        assert (one.place.state == KeypointState.TRACKED) == is_right
        assert is_right or one.reason == "the cameras contradict each other"


@pytest.mark.parametrize("seed", range(4))
def test_whoever_waves_in_the_first_image_is_tracked(seed: int) -> None:
    """A torso that is turned away, with arms that fit, is better than one with hanging arms."""
    pose = aside(np.radians(29.0))
    found = followed(sightings(waving(20, 1.0 / 15.0), pose=pose), (CAMERA, OTHER), pose, seed)
    assert all(one.posture is not None for one in found)
    assert np.mean([one.state == TRACKING for one in found]) > 0.5


@pytest.mark.parametrize("degrees", [9.0, 29.0, 69.0])
def test_nothing_is_tracked_with_an_inverted_pose_or_exchanged_images(degrees: float) -> None:
    pose = aside(np.radians(degrees))
    frames = sightings(waving(30, 1.0 / 15.0), pose=pose)
    swapped = [Sighting(one.state, one.other, one.first) for one in frames]
    right = followed(frames, (CAMERA, OTHER), pose)
    assert np.mean([one.state == TRACKING for one in right]) > 0.3
    inverted = followed(frames, (CAMERA, OTHER), pose.inverse())
    exchanged = followed(swapped, (OTHER, CAMERA), pose)
    for wrong in (*inverted, *exchanged):
        assert wrong.state != TRACKING
        assert KeypointState.TRACKED not in (wrong.keypoint_states or ())
