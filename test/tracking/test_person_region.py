"""Of a silhouette with other things in it, the person's part."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import default_preset, paper_preset
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.person_region import CHANGED, SAME, PersonRegion, StillThings
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(160, 120, 100.0, 100.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.4)
FRONT = reference_posture("front")
WALL, DOOR, CLOTH = 200, 60, 140


def person(lateral_m: float = 0.0, arms: str = "front") -> np.ndarray:
    posture = reference_posture(arms)
    posture[0] = lateral_m
    return render(cardbox_patches(BODY, posture), CAMERA)


def box(left: int, right: int, top: int = 0, bottom: int = 120) -> np.ndarray:
    image = np.zeros((120, 160), np.uint8)
    image[top:bottom, left:right] = 255
    return image


def region() -> PersonRegion:
    return PersonRegion(BODY, CAMERA)


def error_m(estimate: Estimate) -> float:
    """Mean distance of the keypoints to those of the front posture."""
    true_m = CAMERA.reference_to_optical(pose(BODY.rigid, FRONT).keypoints_m)
    return float(np.linalg.norm(estimate.keypoints_m - true_m, axis=1).mean())


def common(one: np.ndarray, other: np.ndarray) -> float:
    """Intersection over union."""
    return np.count_nonzero(one & other) / np.count_nonzero(one | other)


def test_a_silhouette_of_one_person_is_not_touched() -> None:
    chosen, pixels = region(), person()
    for posture in (None, FRONT, FRONT):
        assert chosen.select(pixels, posture, True) is pixels


@pytest.mark.parametrize("thing", [box(2, 30), box(130, 158, 60), box(145, 150, 10, 16)])
def test_a_thing_beside_the_person_is_left_out(thing: np.ndarray) -> None:
    chosen = region()
    for posture in (FRONT, FRONT):
        np.testing.assert_array_equal(chosen.select(person() | thing, posture, True), person())


def test_without_a_posture_head_and_shoulders_are_found() -> None:
    # The door is larger, and where the person was measured.
    found = region().select(person(0.45) | box(40, 80), None, True)
    np.testing.assert_array_equal(found, person(0.45))


def test_a_poor_posture_on_a_thing_is_left_for_the_person() -> None:
    aside = FRONT.copy()
    aside[0] = -0.55
    pixels = person(0.45) | box(20, 50)
    assert common(region().select(pixels, aside, True), box(20, 50)) > 0.8
    np.testing.assert_array_equal(region().select(pixels, aside, False), person(0.45))


def test_who_left_is_not_followed_by_a_chair() -> None:
    chosen, chair = region(), box(130, 158, 50)
    grey = np.where(chair > 0, DOOR, WALL).astype(np.uint8)
    for _ in range(10):
        chosen.select(person() | chair, FRONT, True, grey)
    for posture in (FRONT, None, None):
        assert not chosen.select(chair, posture, True, grey).any()
    again = chosen.select(person() | chair, None, True, grey)
    np.testing.assert_array_equal(again, person())


def test_a_hand_without_its_forearm_stays_the_persons() -> None:
    chosen, whole = region(), person(arms="arms")
    arms = reference_posture("arms")
    assert chosen.select(whole, arms, True) is whole
    columns = np.flatnonzero(whole.any(axis=0))
    gap = box(columns[-1] - 16, columns[-1] - 10)
    # The last posture has the arm elsewhere.
    cut = whole & ~gap
    np.testing.assert_array_equal(chosen.select(cut, FRONT, True), cut)


def test_more_than_can_be_reached_is_left_out_where_it_touches() -> None:
    person_px = person(arms="arms")
    found = region().select(person_px | box(120, 160), reference_posture("arms"), True)
    assert not found[:, 152:].any() and common(found, person_px) > common(
        person_px | box(120, 160), person_px
    )


def test_where_all_is_foreground_nothing_is_cut_out() -> None:
    # A lamp: the tracker has to see that this is no person.
    assert region().select(box(0, 160), FRONT, True).all()


def test_a_thing_is_known_after_eight_images_and_forgotten_after_ten_seconds_of_others() -> None:
    things = StillThings()
    grey, thing = np.full((2, 8), 100, np.uint8), np.full((2, 8), 2, np.uint8)
    for number in range(200):
        things.learn(grey, thing)
        assert (things.compare(grey) == SAME).all() == (number >= 7)
    assert (things.compare(grey + np.uint8(18)) == SAME).all()
    assert (things.compare(grey + np.uint8(19)) == CHANGED).all()
    # At 15 Hz, less the half a second after which things are known.
    counts = [things.learn(grey + np.uint8(50), thing) or things.compare(grey) for _ in range(160)]
    assert [int((one == SAME).all()) for one in counts] == [1] * 142 + [0] * 18


@pytest.mark.parametrize("channels", [1, 3])
def test_an_arm_before_an_open_door(channels: int) -> None:
    chosen, door, reaching = region(), box(104, 140), person(arms="arms")

    def image(of: np.ndarray) -> np.ndarray:
        grey = np.where(of > 0, CLOTH, np.where(door > 0, DOOR, WALL)).astype(np.uint8)
        return grey if channels == 1 else cv2.merge([grey] * 3)

    assert np.count_nonzero(reaching & door) > 60
    for _ in range(10):
        chosen.select(person() | door, FRONT, True, image(person()))
    found = chosen.select(reaching | door, reference_posture("arms"), True, image(reaching))
    np.testing.assert_array_equal(found, reaching)
    # Nor where the arm was not expected.
    found = chosen.select(reaching | door, FRONT, True, image(reaching))
    assert common(found, reaching) > 0.95


def test_only_the_default_preset_selects() -> None:
    pixels = person() | box(2, 45) | box(118, 158)
    states = {}
    for name, config in (
        ("paper", paper_preset()),
        ("off", replace(default_preset(), select_person=False)),
        ("default", default_preset()),
    ):
        tracker = Tracker(BODY, CAMERA, config)
        states[name] = [tracker.track(pixels) for _ in range(3)][-1]
    assert states["off"].state == LOST
    assert states["paper"].state == UNCERTAIN
    assert states["default"].state in (TRACKING, UNCERTAIN)
    assert states["default"].iou > 0.9 > 0.2 > states["paper"].iou
    assert error_m(states["default"]) < 0.03


def test_a_chair_alone_is_nobody() -> None:
    tracker, chair = Tracker(BODY, CAMERA, default_preset()), box(130, 158, 30)
    grey = np.where(chair > 0, DOOR, WALL).astype(np.uint8)
    estimate = [tracker.track(person() | chair, grey) for _ in range(10)][-1]
    assert estimate.state in (TRACKING, UNCERTAIN)
    assert error_m(estimate) < 0.03
    assert [tracker.track(chair, grey).state for _ in range(3)] == [NO_PERSON] * 3
    assert error_m(tracker.track(person() | chair, grey)) < 0.07
