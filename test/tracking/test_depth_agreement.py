"""Depth of another camera's view is found by the person's outline, and not used."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.precompile import quickest
from cardbox_tracker.tracking.tracked_camera import DepthAgreement, surplus_of_jumps
from cardbox_tracker.tracking.tracker import Tracker

BODY, CAMERA = BodyModel(), Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
SHAPE = 120, 160
PERSON = (slice(20, 120), slice(60, 100))


def silhouette() -> np.ndarray:
    mask = np.zeros(SHAPE, np.uint8)
    mask[PERSON] = 255
    return mask


def depth(person_m: float, wall_m: float, columns: int = 0) -> np.ndarray:
    """A wall and a person before it, who stands a number of columns to the right."""
    image = np.full(SHAPE, wall_m, np.float32)
    image[np.roll(silhouette(), columns, axis=1) > 0] = person_m
    return image


@pytest.mark.parametrize("wall_m", [2.1, 6.0, np.nan, 0.0])
def test_depth_grows_everywhere_at_the_outline_of_its_own_person(wall_m: float) -> None:
    assert surplus_of_jumps(silhouette(), depth(2.0, wall_m)) == 1.0


def test_a_jump_less_than_a_sensors_noise_is_none() -> None:
    # 2 % of 5 m are 10 cm.
    assert surplus_of_jumps(silhouette(), depth(5.0, 5.09)) == 0.0
    assert surplus_of_jumps(silhouette(), depth(5.0, 5.11)) == 1.0


def test_an_outline_that_is_wide_by_a_hundredth_of_the_image_still_shows_the_view() -> None:
    mask, image = np.zeros((480, 640), np.uint8), np.full((480, 640), 3.0)
    mask[100:, 240:400] = 255
    image[108:, 248:392] = 2.0
    surplus = surplus_of_jumps(mask, image)
    assert surplus is not None and surplus > 0.9


def test_without_depth_there_is_no_verdict() -> None:
    nothing = np.zeros(SHAPE, np.float32)
    assert surplus_of_jumps(silhouette(), nothing) is None
    assert surplus_of_jumps(np.zeros(SHAPE, np.uint8), depth(2.0, 3.0)) is None


def test_depth_shrinks_as_often_as_it_grows_elsewhere() -> None:
    # The left side is over the wall; the right side, and the top over the person, jump outwards.
    beside = surplus_of_jumps(silhouette(), depth(2.0, 3.0, columns=20))
    assert beside is not None
    assert beside < 0.25
    assert surplus_of_jumps(silhouette(), depth(2.0, 3.0, columns=41)) == pytest.approx(
        -0.4, abs=0.2
    )
    assert surplus_of_jumps(silhouette(), np.full(SHAPE, 3.0, np.float32)) == 0.0


def test_no_depth_is_no_other_view() -> None:
    agreement = DepthAgreement()
    assert all(agreement.accepted(silhouette(), None) is None for _ in range(60))
    assert agreement.remark() == ""


def test_a_tracker_tells_depth_of_another_view_and_does_not_use_it() -> None:
    mask = render(cardbox_patches(BODY, reference_posture("front")), CAMERA)
    config = quickest(PRESETS["default"]()).with_depth()
    wrong, without = Tracker(BODY, CAMERA, config), Tracker(BODY, CAMERA, config)
    # What is seen is a corner of another room.
    depth_m = np.linspace(1.0, 3.0, mask.size, dtype=np.float32).reshape(mask.shape)
    for _ in range(20):
        wrong.track(Observation(mask, depth_m=depth_m))
    (text,) = wrong.remarks()
    assert "another view" in text
    frame = wrong.frames([Observation(mask, depth_m=depth_m)])[0]
    assert frame.depth_m is None
    for _ in range(20):
        without.track(Observation(mask))
    assert without.remarks() == []
