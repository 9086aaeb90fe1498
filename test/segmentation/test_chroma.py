"""Colours that differ from the empty scene's, whatever the brightness: made by hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.chroma import (
    ChromaModel,
    ChromaScore,
    bgr_of,
    chroma_planes,
    colors_of,
)
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.segmentation.window import Window

H, W = 120, 160
PERSON = (slice(30, 110), slice(60, 100))
WALL = (150, 140, 120)


def scene(person: tuple[float, ...] | None = None) -> np.ndarray:
    made = np.zeros((H, W, 3))
    made[:] = WALL
    if person is not None:
        made[PERSON] = person
    return made.round().astype(np.uint8)


def extractor(config: BackgroundConfig | None = None, sigma: float = 0.0) -> SilhouetteExtractor:
    learner, rng = BackgroundLearner(), np.random.default_rng(0)
    for _ in range(10):
        learner.add(noisy(scene(), sigma, rng))
    return SilhouetteExtractor(learner.model(), config)


def noisy(image: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    return np.clip(image + rng.normal(0, sigma, image.shape) + 0.5, 0, 255).astype(np.uint8)


def wrong(silhouette: np.ndarray) -> int:
    truth = np.zeros((H, W), bool)
    truth[PERSON] = True
    return int(np.count_nonzero((silhouette > 0) != truth))


def as_bright_as_the_wall() -> tuple[float, ...]:
    """Yellow (bgr) that becomes the same grey as the wall."""
    wall = cv2.cvtColor(np.full((1, 1, 3), WALL, np.uint8), cv2.COLOR_BGR2GRAY).item()
    yellow = np.array([60.0, 150.0, 160.0])
    grey = cv2.cvtColor(yellow.astype(np.uint8).reshape(1, 1, 3), cv2.COLOR_BGR2GRAY).item()
    return tuple(yellow * wall / grey)


@pytest.mark.parametrize("sigma", [0.0, 5.0])
def test_clothes_as_bright_as_the_wall_are_found_by_their_colour(sigma: float) -> None:
    image = noisy(scene(as_bright_as_the_wall()), sigma, np.random.default_rng(1))
    # The outline is 240 px long.
    assert wrong(extractor(sigma=sigma)(image)) < 100
    without = extractor(BackgroundConfig(color=False), sigma)(image)
    assert np.count_nonzero(without) < 300


def test_colours_smeared_by_jpeg_do_not_widen_the_outline() -> None:
    image = scene((30, 30, 220))
    image = cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 70])[1], 1)
    assert wrong(extractor()(image)) < 240


@pytest.mark.parametrize("factor", [0.65, 0.8, 1.25])
def test_another_brightness_is_no_colour(factor: float) -> None:
    planes = chroma_planes(scene()).astype(np.float32)
    score = ChromaScore(ChromaModel(planes, np.ones_like(planes)), 2.0, 7.0, 0.5)
    assert not score(colors_of((scene() * factor).astype(np.uint8)), (H, W)).any()
    assert score(colors_of(scene(as_bright_as_the_wall())), (H, W))[PERSON].mean() > 0.95 * 255


def test_planes_turn_back_into_channels() -> None:
    image = np.random.default_rng(0).integers(0, 256, (20, 20, 3)).astype(np.uint8)
    planes = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(np.float32).transpose(2, 0, 1)
    within = ((planes[1:] > 0) & (planes[1:] < 255)).all(axis=0)
    np.testing.assert_allclose(
        bgr_of(planes)[:, within], image.transpose(2, 0, 1)[:, within], atol=2
    )


def test_grey_images_still_work_before_a_background_in_colour() -> None:
    grey = cv2.cvtColor(scene((40, 40, 40)), cv2.COLOR_BGR2GRAY)
    assert wrong(extractor()(grey)) <= 8


def test_one_grey_image_among_the_learned_ones_turns_colour_off() -> None:
    for order in ((0, 1), (1, 0)):
        learner = BackgroundLearner()
        for index in order:
            learner.add((scene(), scene()[..., 0])[index])
        assert learner.count == 2
        assert learner.model().chroma is None


def test_the_plain_rule_knows_no_colour() -> None:
    image = scene(as_bright_as_the_wall())
    assert not extractor(BackgroundConfig(clean_up=False))(image).any()


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(2, 30), st.integers(2, 40)),
    st.floats(0.0, 1.0, width=32),
)
def test_equal_to_numpy(seed: int, shape: tuple[int, int], edge: float) -> None:
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (*shape, 3), np.uint8)
    small = (3, shape[0] // 2, shape[1] // 2)
    mean = rng.uniform(0, 255, small).astype(np.float32)
    stddev = rng.uniform(0, 9, small).astype(np.float32)
    planes = chroma_planes(image).astype(np.float32)
    ratio = planes[0] / np.maximum(mean[0], 8)
    apart = planes[1:] - 128 - ratio * (mean[1:] - 128)
    score = np.hypot(*(apart / np.maximum(2 * stddev[1:], 7)))
    brightest = cv2.dilate(bgr_of(mean).max(axis=0), np.ones((3, 3), np.uint8))
    score[ratio * brightest.reshape(score.shape) >= 245] = 0
    highest = cv2.dilate(score, np.ones((7, 7), np.uint8)).reshape(score.shape)
    margin = np.minimum(score - 1, score - edge * highest).astype(np.float32)
    expected = np.asarray(cv2.resize(margin, shape[::-1])).reshape(shape)
    score = ChromaScore(ChromaModel(mean, stddev), 2.0, 7.0, edge)
    made = score(colors_of(image), shape).reshape(shape)
    # The last bits of a margin may differ.
    is_clear = np.abs(expected) > 1e-3
    np.testing.assert_array_equal(made[is_clear], np.where(expected >= 0, 255, 0)[is_clear])


@pytest.mark.parametrize("follow", [True, False])
def test_the_white_balance_of_the_whole_image_is_followed(follow: bool) -> None:
    planes = chroma_planes(scene()).astype(np.float32)
    score = ChromaScore(ChromaModel(planes, np.ones_like(planes)), 2.0, 7.0, 0.5, follow)
    warmer = colors_of((scene() * (0.85, 1.0, 1.15)).astype(np.uint8))
    assert score(warmer, (H, W)).all() != follow


def test_a_window_gives_the_same_inside() -> None:
    rng = np.random.default_rng(3)
    planes = chroma_planes(scene()).astype(np.float32)
    score = ChromaScore(ChromaModel(planes, np.ones_like(planes)), 2.0, 7.0, 0.5)
    image = noisy(scene(as_bright_as_the_wall()), 5.0, rng)
    whole, window = score(colors_of(image), (H, W)).copy(), Window(16, 96, 24, 104)
    part = score(colors_of(image), (H, W), window)
    assert 0 < np.count_nonzero(part) < part.size
    # At its edges the surroundings are missing.
    np.testing.assert_array_equal(part[8:-8, 8:-8], whole[window.slices][8:-8, 8:-8])


def test_what_only_its_colour_shows_is_followed_from_image_to_image() -> None:
    made, whole = extractor(), np.zeros(8)
    for number in range(1, 20):
        image = np.roll(scene(as_bright_as_the_wall()), 2 * number, axis=1)
        whole = extractor()(image)
        assert np.count_nonzero(made(image) != whole) < 0.02 * np.count_nonzero(whole)


def test_the_white_balance_of_an_image_of_one_square_is_that_of_its_colour() -> None:
    """An image of 2x2 px has one pixel at half the resolution, which is its own neighbour."""
    colors = np.array([100, 148, 118], np.uint8).reshape(3, 1, 1)
    model = ChromaModel(
        np.array([100, 128, 128], np.float32).reshape(3, 1, 1), np.ones((3, 1, 1), np.float32)
    )
    score = ChromaScore(model, 2.0, 7.0, 0.5, follow=True)
    assert not score(colors, (2, 2)).any()
    np.testing.assert_allclose(score.without_cast(model).mean.ravel(), [100, 108, 138], rtol=1e-5)


@pytest.mark.parametrize("shape", [(3, 0), (3, 1), (2, 4, 4), (3, 0, 4), (3, 4, 0)])
def test_a_scene_without_pixels_is_refused(shape: tuple[int, ...]) -> None:
    nothing = np.zeros(shape, np.float32)
    with pytest.raises(ValueError, match=r"expected (pixels|\(3, any, any\))"):
        ChromaScore(ChromaModel(nothing, nothing), 3.0, 2.0, 0.5)
