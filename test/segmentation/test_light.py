"""Changing light is followed, and nobody becomes background."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.segmentation.light import LightFollower

H, W = 120, 160
PERSON = (slice(30, 120), slice(60, 95))
WALL = np.array([120.0, 115.0, 105.0])
SHIRT = np.array([60.0, 62.0, 90.0])
FPS = 15
Factor = float | np.ndarray


def truth() -> np.ndarray:
    mask = np.zeros((H, W), bool)
    mask[PERSON] = True
    return mask


class Room:
    """A textured wall, learned in its first light, then images of it in other lights."""

    def __init__(
        self, grey: bool, seed: int = 0, brightness: float = 1.0, **config: object
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.grey = grey
        self.wall = brightness * WALL * self.rng.uniform(0.9, 1.1, (H, W, 1))
        learner = BackgroundLearner()
        for _ in range(20):
            learner.add(self.image(1.0, None))
        self.extractor = SilhouetteExtractor(learner.model(), BackgroundConfig(**config))  # type: ignore[arg-type]

    def image(self, light: Factor, person: np.ndarray | None) -> np.ndarray:
        made = self.wall.copy()
        if person is not None:
            made[PERSON] = person
        factor = light if isinstance(light, float) else light[..., None]
        noisy = made * factor + self.rng.normal(0, 2, made.shape) + 0.5
        image = np.clip(noisy, 0, 255).astype(np.uint8)
        return image[..., 1].copy() if self.grey else image

    def iou(self, light: Factor, person: np.ndarray = SHIRT) -> float:
        found = self.extractor(self.image(light, person)) > 0
        return float((found & truth()).sum() / (found | truth()).sum())


@pytest.mark.parametrize("grey", [True, False])
@pytest.mark.parametrize(
    "light",
    [
        lambda t: 1.0 + 0.3 * float(np.sin(2 * np.pi * t / 60)),
        lambda t: 1.0 - 0.3 * float(np.sin(2 * np.pi * t / 60)),
        lambda t: 1.35 if int(t / 4) % 2 else 1.0,
        lambda t: (1.0, 0.7, 1.3, 0.6)[int(t / 4) % 4],
    ],
    ids=["drift up", "drift down", "lamp", "steps of the gain"],
)
def test_the_level_of_the_light_is_followed(grey: bool, light: Callable[[float], float]) -> None:
    room = Room(grey)
    # The images between two of these are left out: the changes are only larger for it.
    figures = [room.iou(light(t)) for t in np.arange(0, 30, 0.25)]
    assert min(figures) > 0.93
    # Without, the same light is lost.
    assert min(Room(grey, follow=False).iou(light(t)) for t in (0.0, 6.0, 15.0)) < 0.5


@pytest.mark.parametrize("grey", [True, False])
def test_a_lamp_at_one_side_is_followed(grey: bool) -> None:
    room = Room(grey)
    x = np.arange(W) / W
    lamp = np.tile(1.0 + 0.4 * (0.3 + 0.7 * np.exp(-((x - 0.1) ** 2) / 0.2)), (H, 1))
    for _ in range(FPS):
        room.iou(1.0)
    lit = [room.iou(lamp) for _ in range(4 * FPS)]
    assert np.mean(lit[2 * FPS :]) > 0.93
    off = [room.iou(1.0) for _ in range(4 * FPS)]
    assert np.mean(off[2 * FPS :]) > 0.93


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.75, 0.1), (1.0, 0.9)])
def test_a_lamp_that_cuts_off_the_wall_does_not_become_foreground(
    place: tuple[float, float],
) -> None:
    room = Room(grey=False, brightness=1.6)
    y, x = np.mgrid[:H, :W] / W
    far = (x - place[0]) ** 2 + (y - place[1] * H / W) ** 2
    lamp = 1.0 + 0.5 * np.exp(-far / (2 * 0.35**2))
    assert np.mean(room.image(lamp, None).max(axis=-1) == 255) > 0.01
    for _ in range(FPS):
        room.iou(1.0)
    lit = [room.iou(lamp) for _ in range(4 * FPS)]
    assert np.mean(lit[-FPS:]) > 0.9
    off = [room.iou(1.0) for _ in range(3 * FPS)]
    assert np.mean(off[-FPS:]) > 0.93


@pytest.mark.parametrize("grey", [True, False])
@pytest.mark.parametrize("level", [0.55, 0.75, 1.3])
def test_a_person_who_stands_still_is_never_absorbed(grey: bool, level: float) -> None:
    room = Room(grey)
    clothes = WALL * level
    first = np.mean([room.iou(1.0, clothes) for _ in range(5)])
    figures = [room.iou(1.0, clothes) for _ in range(20 * FPS)]
    assert first > 0.9
    assert min(figures) > first - 0.04


def test_a_channel_that_is_cut_off_is_expected() -> None:
    window = np.array([235.0, 225.0, 200.0])
    learner, rng = BackgroundLearner(), np.random.default_rng(0)

    def image(light: float) -> np.ndarray:
        made = np.tile(WALL, (H, W, 1))
        made[10:60, 100:150] = window
        return np.clip(made * light + rng.normal(0, 2, made.shape) + 0.5, 0, 255).astype(np.uint8)

    for _ in range(20):
        learner.add(image(1.0))
    extractor = SilhouetteExtractor(learner.model())
    for light in np.linspace(1.0, 1.3, 30):
        found = extractor(image(float(light)))
        # Where window and wall meet, a pixel at half the resolution has something of both.
        assert not found[14:56, 104:146].any()
        assert np.count_nonzero(found) < 0.02 * H * W


def test_another_white_balance_is_followed() -> None:
    room = Room(grey=False)
    balance = np.array([0.85, 1.0, 1.15])
    room.wall = room.wall * balance
    assert min(room.iou(1.0, SHIRT * balance) for _ in range(5)) > 0.93
    rigid = Room(grey=False, follow=False)
    rigid.wall = rigid.wall * balance
    assert rigid.iou(1.0, SHIRT * balance) < 0.5


def test_a_scene_wholly_covered_or_black_does_no_harm() -> None:
    room = Room(grey=False)
    for value in (0, 255, 128):
        room.extractor(np.full((H, W, 3), value, np.uint8))
    figures = [room.iou(1.0) for _ in range(2 * FPS)]
    assert figures[-1] > 0.93


def test_restarted_it_does_not_remember() -> None:
    images = [Room(False, seed=3).image(1.0 + 0.03 * k, SHIRT) for k in range(8)]
    room = Room(False)
    first = [room.extractor(image) for image in images]
    room.extractor.restart()
    np.testing.assert_array_equal(first, [room.extractor(image) for image in images])


def test_the_level_by_hand() -> None:
    follower = LightFollower(np.full((H, W), 100, np.float32))
    background, factor = follower.follow(np.full((H, W), 120, np.uint8))
    assert follower.level == pytest.approx(1.2)
    np.testing.assert_allclose(factor * background, 120, rtol=1e-3)
    follower.restart()
    assert follower.level == 1.0
    dark = LightFollower(np.full((H, W), 2, np.float32))
    background, factor = dark.follow(np.full((H, W), 4, np.uint8))
    np.testing.assert_allclose(factor * background, 2)


def test_a_bright_place_is_limited_by_hand() -> None:
    """The wall grows from 100 to 150; of a place at 200, more than 255 cannot be seen."""
    mean = np.full((H, W), 100, np.float32)
    mean[:20, :20] = 200
    background, factor = LightFollower(mean).follow(np.full((H, W), 150, np.uint8))
    np.testing.assert_allclose(factor * background, np.where(mean == 200, 255, 150), rtol=1e-3)


def test_people_count_for_the_level_only_if_little_else_is_seen() -> None:
    follower = LightFollower(np.full((H, W), 100, np.float32))
    image, person = np.full((H, W), 100, np.uint8), np.zeros((H, W), np.uint8)
    image[:75], person[:55] = 120, 255
    follower.follow(image)
    assert follower.level == pytest.approx(1.2)
    follower.exclude(person)
    follower.follow(image)
    assert follower.level == pytest.approx(1.0)
    # As after most of the image was covered: nothing is left but what is thought to be people.
    covered = LightFollower(np.full((H, W), 100, np.float32))
    covered._person[:] = 255
    covered.follow(image)
    assert covered.level == pytest.approx(1.2)


@pytest.mark.parametrize("grey", [True, False])
@pytest.mark.parametrize("light", [1.5, 2.2])
def test_a_wall_that_becomes_white_is_no_person(grey: bool, light: float) -> None:
    """Only the person is within the camera's range, and is not taken for the light."""
    room = Room(grey, brightness=1.5)
    assert room.iou(1.0) > 0.9
    assert min(room.iou(light) for _ in range(20)) > 0.9
    assert min(room.iou(1.0) for _ in range(5)) > 0.9
