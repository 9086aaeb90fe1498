"""What was moved and stays becomes background, and nobody who stands still does."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.segmentation.absorption import STILL, StillRegions
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner

AFTER = 60
# The absorber sees a thing at the end of fifteen images, and learns it from the next fifteen.
ENOUGH = AFTER + 45
DOOR = (slice(20, 110), slice(120, 150))


def learned(room: Any, color: bool = False, **config: Any) -> SilhouetteExtractor:
    learner = BackgroundLearner()
    for _ in range(20):
        learner.add(shown(room.image(), color))
    return SilhouetteExtractor(learner.model(), BackgroundConfig(absorb_after=AFTER, **config))


def shown(image: np.ndarray, color: bool) -> np.ndarray:
    if not color:
        return image
    channels = (0.8 * image, image, np.minimum(1.1 * image, 255))
    return np.stack(channels, axis=-1).astype(np.uint8)


def standing(room: Any, at: float, number: int, **light: float) -> np.ndarray:
    """An image of somebody who sways as people do, slowly and by half a pixel, some millimetres."""
    return room.image(at + 0.5 * np.sin(2 * np.pi * 0.3 * number / 15), sway_px=0.0, **light)


def open_door(room: Any) -> None:
    room.wall[DOOR] = 40.0


@pytest.mark.parametrize("color", [False, True])
def test_a_door_left_open_becomes_background(room: Any, color: bool) -> None:
    extractor = learned(room, color)
    open_door(room)
    found = [
        np.count_nonzero(extractor(shown(standing(room, 60, k), color))[DOOR])
        for k in range(ENOUGH)
    ]
    assert min(found[: AFTER - 15]) > 0.9 * 90 * 30
    silhouette = extractor(shown(standing(room, 60, 0), color)) > 0
    assert not silhouette[:, 105:].any()
    person = room.person(60)
    assert np.count_nonzero(silhouette & person) > 0.95 * np.count_nonzero(person)


def test_the_place_that_a_chair_was_taken_from_becomes_background(room: Any) -> None:
    wall = room.wall.copy()
    open_door(room)
    extractor = learned(room)
    room.wall = wall
    assert extractor(room.image())[DOOR].all()
    for _ in range(ENOUGH):
        extractor(room.image())
    assert not extractor(room.image()).any()


def test_nobody_who_stands_still_becomes_background(room: Any) -> None:
    extractor = learned(room)
    person = room.person(60)
    least = min(
        np.count_nonzero(extractor(standing(room, 60, k))[person]) for k in range(5 * AFTER)
    )
    assert least > 0.9 * np.count_nonzero(person)


def test_what_somebody_touches_stays_foreground_until_they_leave(room: Any) -> None:
    extractor = learned(room)
    open_door(room)
    for k in range(3 * AFTER):
        silhouette = extractor(standing(room, 112, k))
    assert np.count_nonzero(silhouette[DOOR]) > 0.9 * 90 * 30
    for k in range(ENOUGH):
        extractor(standing(room, 40, k))
    assert not extractor(room.image())[DOOR].any()


def test_what_was_absorbed_in_other_light_is_background_in_the_light_of_before(room: Any) -> None:
    extractor = learned(room)
    open_door(room)
    for k in range(ENOUGH):
        extractor(standing(room, 60, k, gain=1.25))
    for k in range(15):
        silhouette = extractor(standing(room, 60, k))
    assert not silhouette[:, 105:].any()


def test_without_the_setting_nothing_is_absorbed(room: Any) -> None:
    learner = BackgroundLearner()
    for _ in range(20):
        learner.add(room.image())
    extractor = SilhouetteExtractor(learner.model(), BackgroundConfig(absorb_after=0))
    open_door(room)
    for _ in range(2 * ENOUGH):
        silhouette = extractor(room.image())
    assert silhouette[DOOR].all()


@pytest.mark.parametrize(("rate_hz", "is_absorbed"), [(20, True), (39, False)])
def test_only_20_images_a_second_count(room: Any, rate_hz: int, is_absorbed: bool) -> None:
    extractor = learned(room)
    open_door(room)
    for number in range(ENOUGH):
        silhouette = extractor(room.image(), 1 + number * 10**9 // rate_hz)
    assert silhouette[DOOR].any() != is_absorbed


def test_restarted_it_does_not_remember(room: Any) -> None:
    extractor = learned(room)
    open_door(room)
    images = [standing(room, 60, k) for k in range(ENOUGH)]
    first = [extractor(image) for image in images]
    assert first[0][DOOR].any() and not first[-1][DOOR].any()
    extractor.restart()
    np.testing.assert_array_equal(first, [extractor(image) for image in images])


def test_a_head_apart_from_a_moving_body_is_no_thing() -> None:
    regions = StillRegions(AFTER)
    silhouette = np.zeros((200, 200), np.uint8)
    silhouette[20:60, 80:120] = 255  # the head, which keeps still
    silhouette[70:, 60:140] = 255  # 10 px below it the body
    for number in range(2 * AFTER):
        image = np.where(silhouette > 0, 190, 90).astype(np.uint8)
        image[70:, 60:140] = 90 + 100 * (number // 15 % 2)
        found = regions.add(image, silhouette, 1.0)
        assert found is None or not found.any()


@pytest.mark.parametrize(("moved", "is_thing"), [(0.5 * STILL, True), (2.0 * STILL, False)])
def test_the_share_that_may_move_by_hand(moved: float, is_thing: bool) -> None:
    silhouette = np.zeros((100, 800), np.uint8)
    silhouette[:, 100:700] = 255
    # What is near reaches 8 px farther at both sides.
    columns = round(moved * 616)
    regions = StillRegions(AFTER)
    found = []
    for number in range(AFTER + 15):
        image = np.full((100, 800), 100, np.uint8)
        image[:, 300 : 300 + 2 * (columns // 2)] = 160 if number // 15 % 2 else 100
        found.append(regions.add(image, silhouette, 1.0))
    assert all((mask is None) == (number % 15 != 14) for number, mask in enumerate(found))
    assert found[-1] is not None
    assert found[-1].any() == is_thing


def test_images_are_halved_as_by_opencv() -> None:
    rng = np.random.default_rng(0)
    for shape in ((40, 60), (41, 60)):
        images = rng.integers(0, 256, (15, *shape), np.uint8)
        silhouettes = np.where(rng.random((15, *shape)) < 0.02, 255, 0).astype(np.uint8)
        regions = StillRegions(AFTER)
        for image, silhouette in zip(images[:14], silhouettes[:14], strict=True):
            assert regions.add(image, silhouette, 1.0) is None
        small = [cv2.resize(i, (30, 20), interpolation=cv2.INTER_AREA) for i in images[:14]]
        seen = [cv2.resize(s, (30, 20), interpolation=cv2.INTER_AREA) for s in silhouettes[:14]]
        np.testing.assert_array_equal(regions._sum, np.sum(small, axis=0, dtype=float))
        np.testing.assert_array_equal(regions._seen > 0, np.any(np.array(seen) > 0, axis=0))
