"""Changing light is followed, and nobody becomes background."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.segmentation.light import LightFollower, multiply_field, update_field
from cardbox_tracker.segmentation.light_outlines import average_blocks, find_smooth, grow_person
from cardbox_tracker.segmentation.light_samples import (
    limit_channels,
    measure_level,
    sum_cells,
    take_samples,
)

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


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 30), st.integers(1, 40)),
    st.sampled_from([0.9, 1.0, 50.0]),
)
def test_the_sums_are_those_of_numpy(seed: int, shape: tuple[int, int], last: float) -> None:
    rng = np.random.default_rng(seed)
    small = rng.integers(0, 256, shape, np.uint8)
    mean, brightest = rng.uniform(0, 255, (2, *shape)).astype(np.float32)
    field = rng.uniform(0.7, 1.4, shape).astype(np.float32)
    person = (rng.random(shape) < 0.3).astype(np.uint8)
    ratio = small / np.maximum(mean, np.float32(1))
    known = (person == 0) & (ratio * brightest < 250)
    image, samples = rng.integers(0, 256, [4 * length for length in shape], np.uint8), small + 1
    image[1::4, 1::4] = small
    ratios = np.zeros(small.size + 2, np.float32)
    given = image, samples, mean, brightest, field, person, ratios, ratios.view(np.int32), last
    level = measure_level(*given, 0.0)
    np.testing.assert_array_equal(samples, small)
    usable = np.sort((ratio / field)[known])
    assert level == (pytest.approx(usable[len(usable) // 2], rel=1e-5) if len(usable) else -1)
    # With too few pixels outside the person, those of the person count.
    level = measure_level(*given, 1.1)
    usable = np.sort((ratio / field)[ratio * brightest < 250])
    assert level == (pytest.approx(usable[len(usable) // 2], rel=1e-5) if len(usable) else -1)
    cells = np.empty((3, 4, 2), np.float32)
    base = rng.uniform(0.8, 1.2, shape).astype(np.float32)
    sum_cells(small, mean, brightest, field, base, person, 1.2, 0.4, cells)
    change = ratio / np.float32(1.2) / field - 1
    # What is cut off is a lower bound.
    seen = (person == 0) & ((ratio * brightest < 250) | (change > 0))
    used = seen & (np.abs(change) < 0.4)
    share = 12 / small.size
    assert cells[..., 1].sum() == pytest.approx(share * used.sum(), abs=1e-3)
    assert cells[..., 0].sum() == pytest.approx(
        share * (ratio / 1.2 / base - 1)[used].sum(), abs=1e-2, rel=1e-4
    )


def test_bright_channels_are_limited_by_hand() -> None:
    """The first pixel stays below the limit; of the second, the brightest channel is cut off."""
    mean = np.array([100.0, 200.0], np.float32)
    channels = np.array([[90.0, 150.0], [100.0, 200.0], [110.0, 250.0]], np.float32)
    weights = np.array([0.25, 0.5, 0.25], np.float32)
    now = np.empty(2, np.float32)
    light, brightest = (mean, np.float32(1.2), np.float32(240.0)), channels.max(axis=0)
    limit_channels(*light, mean, channels, brightest, brightest[1:], weights, now)
    # 0.25 * 180 + 0.5 * 240 + 0.25 * 255, where 1.2 * 250 is more than 255
    np.testing.assert_allclose(now, [120.0, 228.75])


def test_blocks_of_pixels_without_a_bright_channel_are_only_scaled() -> None:
    rng = np.random.default_rng(0)
    channels = rng.uniform(0, 150, (3, 200)).astype(np.float32)
    channels[:, 70] = 240.0
    weights = np.array([0.25, 0.5, 0.25], np.float32)
    mean, now = weights @ channels, np.empty(200, np.float32)
    brightest = channels.max(axis=0)
    blocks = np.maximum.reduceat(brightest, [0, 64, 128, 192])
    light = mean, np.float32(1.2), np.float32(200.0)
    limit_channels(*light, mean, channels, brightest, blocks, weights, now)
    expected = np.float32(1.2) * mean
    expected[70] = 255.0
    np.testing.assert_allclose(now, expected, rtol=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.tuples(st.integers(1, 9), st.integers(1, 12)))
def test_samples_blocks_and_margins_are_those_of_opencv(seed: int, shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (4 * shape[0], 4 * shape[1]), np.uint8)
    samples, means = np.empty(shape, np.uint8), np.empty(shape, np.float32)
    take_samples(image, samples)
    np.testing.assert_array_equal(samples, image[1::4, 1::4])
    average_blocks(image.view(np.uint32), means)
    small = cv2.resize(image, shape[::-1], interpolation=cv2.INTER_AREA).reshape(shape)
    np.testing.assert_array_equal(means, small)
    silhouette = np.where(rng.random(image.shape) < 0.3, 255, 0).astype(np.uint8)
    without, grown = rng.random(shape) < 0.3, np.empty(shape, np.uint8)
    rest = np.where(without, 0, silhouette[1::4, 1::4]).astype(np.uint8)
    grow_person(silhouette, without, grown)
    expected = cv2.dilate(rest, np.ones((5, 5), np.uint8)).reshape(shape)
    np.testing.assert_array_equal(grown, expected)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 20), st.integers(1, 25)),
    st.sampled_from([0.5, 1.5, 4.0]),
)
def test_smooth_foreground_is_that_of_opencv(
    seed: int, shape: tuple[int, int], blur: float
) -> None:
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(0, 1, shape), (0, 0), blur).reshape(shape)
    means = (100 + 5 * noise / max(noise.std(), 1e-9)).astype(np.float32)
    blocks = np.full(shape, 100, np.float32)
    fine = rng.uniform(0.99, 1.01, shape).astype(np.float32)
    silhouette = np.where(rng.random([4 * length for length in shape]) < 0.6, 255, 0)
    person = silhouette[1::4, 1::4]
    relative = means / (blocks * fine * np.float32(1.01))
    square = np.ones((3, 3), np.uint8)
    varies = (cv2.dilate(relative, square) - cv2.erode(relative, square)).reshape(shape)
    _, labels = cv2.connectedComponents((varies < 0.06).astype(np.uint8), connectivity=4)
    labels = labels.reshape(shape)
    reached = np.isin(labels, np.setdiff1d(labels[person == 0], [0]))
    smooth, lit = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
    count = find_smooth(means, blocks, fine, 1.01, silhouette.astype(np.uint8), smooth, lit)
    np.testing.assert_array_equal(smooth, reached & (person > 0))
    np.testing.assert_array_equal(lit, smooth & (relative > 1))
    assert count == np.count_nonzero(lit)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(2, 20), st.integers(2, 20)),
    st.tuples(st.integers(20, 50), st.integers(20, 50)),
)
def test_the_field_is_updated_as_by_numpy_and_enlarged_as_by_opencv(
    seed: int, shape: tuple[int, int], size: tuple[int, int]
) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.uniform(0, 1, (*shape, 2)).astype(np.float32)
    base, field = rng.uniform(0.8, 1.2, (2, *shape)).astype(np.float32)
    expected = field + 0.3 * (base * (1 + cells[..., 0] / (cells[..., 1] + 0.02)) - field)
    extremes = update_field(cells, base, np.float32(0.3), field)
    np.testing.assert_allclose(field, expected, rtol=1e-4)
    assert extremes == (field.min(), field.max())
    mean, result = rng.uniform(0, 255, (2, *size)).astype(np.float32)
    multiply_field(mean, field, result)
    np.testing.assert_allclose(result, mean * cv2.resize(field, size[::-1]), rtol=1e-4)
