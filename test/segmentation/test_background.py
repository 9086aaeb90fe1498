"""Learning the empty scene and cutting a person out of it, equation (1)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.segmentation import background
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.regions import clean_silhouette
from cardbox_tracker.segmentation.window import window_of

PLAIN = BackgroundConfig(clean_up=False)
H, W = 120, 160
PERSON = (slice(30, 110), slice(60, 100))


def flat(mean: float, stddev: float, shape: tuple[int, int] = (H, W)) -> BackgroundModel:
    return BackgroundModel(np.full(shape, mean, np.float32), np.full(shape, stddev, np.float32))


def image(level: float, person: float | None = None) -> np.ndarray:
    made = np.full((H, W), level)
    if person is not None:
        made[PERSON] = person
    return made.round().astype(np.uint8)


def person_mask() -> np.ndarray:
    mask = np.zeros((H, W), np.uint8)
    mask[PERSON] = 255
    return mask


@given(arrays(np.uint8, st.tuples(st.integers(2, 12), st.just(3), st.just(4))))
def test_mean_and_deviation_are_those_of_numpy(images: np.ndarray) -> None:
    learner = BackgroundLearner()
    for one in images:
        learner.add(one)
    model = learner.model()
    assert learner.count == len(images)
    assert model.mean.dtype == model.stddev.dtype == np.float32
    np.testing.assert_allclose(model.mean, images.mean(axis=0), atol=1e-3)
    np.testing.assert_allclose(model.stddev, images.std(axis=0, ddof=1), atol=1e-2)


def test_mean_and_deviation_by_hand() -> None:
    learner = BackgroundLearner()
    for level in (100, 104, 108):
        learner.add(np.full((2, 2), level, np.uint8))
    np.testing.assert_allclose(learner.model().mean, 104)
    np.testing.assert_allclose(learner.model().stddev, 4)


def test_what_was_learned_stays_when_more_is_added() -> None:
    learner = BackgroundLearner()
    learner.add(np.zeros((2, 2), np.uint8))
    learner.add(np.zeros((2, 2), np.uint8))
    model = learner.model()
    learner.add(np.full((2, 2), 90, np.uint8))
    np.testing.assert_array_equal(model.mean, 0)


@pytest.mark.parametrize("count", [0, 1])
def test_a_deviation_needs_two_images(count: int) -> None:
    learner = BackgroundLearner()
    for _ in range(count):
        learner.add(np.zeros((2, 2), np.uint8))
    with pytest.raises(ValueError, match=f"^{count} images"):
        learner.model()


def test_an_image_of_another_size_is_refused() -> None:
    learner = BackgroundLearner()
    learner.add(np.zeros((4, 6), np.uint8))
    with pytest.raises(ValueError, match=r"\(6, 4\).*\(4, 6\)"):
        learner.add(np.zeros((6, 4), np.uint8))
    for config in (PLAIN, BackgroundConfig()):
        with pytest.raises(ValueError, match=rf"\(6, 4\).*\({H}, {W}\)"):
            SilhouetteExtractor(flat(100, 2), config)(np.zeros((6, 4), np.uint8))


def test_the_plain_rule_fires_from_exactly_the_threshold_on() -> None:
    # 2 x 4 grey levels: 8 is foreground on either side, 7 is not.
    levels = np.array([[100, 107, 108, 109, 93, 92, 91, 0, 255]], np.uint8)
    got = SilhouetteExtractor(flat(100, 4, (1, 9)), PLAIN)(levels)
    assert got.dtype == np.uint8
    assert got.tolist() == [[0, 0, 255, 255, 0, 255, 255, 255, 255]]
    stricter = BackgroundConfig(clean_up=False, threshold=2.25)
    got = SilhouetteExtractor(flat(100, 4, (1, 9)), stricter)(levels)
    assert got.tolist() == [[0, 0, 0, 255, 0, 0, 255, 255, 255]]


@given(
    arrays(np.uint8, (3, 5)),
    arrays(np.float32, (3, 5), elements=st.floats(0, 255, width=32)),
    arrays(np.float32, (3, 5), elements=st.floats(2, 40, width=32)),
)
def test_the_plain_rule_is_equation_1(now: np.ndarray, mean: np.ndarray, dev: np.ndarray) -> None:
    got = SilhouetteExtractor(BackgroundModel(mean, dev), PLAIN)(now)
    difference = np.abs(mean - now.astype(np.float32))
    np.testing.assert_array_equal(got == 255, difference >= 2 * dev)


def test_a_pixel_free_of_noise_does_not_fire_on_one_grey_level() -> None:
    extractor = SilhouetteExtractor(flat(100, 0, (1, 3)), PLAIN)
    # The floor is 1.5 levels, so the rule begins at 3.
    assert extractor(np.array([[101, 102, 103]], np.uint8)).tolist() == [[0, 0, 255]]


@pytest.mark.parametrize("level", [40, 100, 180])
@pytest.mark.parametrize("contrast", [-30, 30])
def test_a_person_is_cut_out_along_the_outline(level: int, contrast: int) -> None:
    got = SilhouetteExtractor(flat(level, 2))(image(level, level + contrast))
    assert set(np.unique(got)) == {0, 255}
    wrong = np.count_nonzero(got != person_mask())
    # The outline is 2 x (80 + 40) px long: at most the four corners may be rounded.
    assert wrong <= 8


def test_a_person_is_cut_out_of_noise() -> None:
    rng = np.random.default_rng(3)
    learner = BackgroundLearner()
    for _ in range(30):
        learner.add((image(100) + rng.normal(0, 3, (H, W))).round().astype(np.uint8))
    noisy = (image(100, 150) + rng.normal(0, 3, (H, W))).round().astype(np.uint8)
    plain = SilhouetteExtractor(learner.model(), PLAIN)(noisy)
    clean = SilhouetteExtractor(learner.model())(noisy)
    # The rule alone flags one pixel in twenty.
    assert 200 < np.count_nonzero(plain != person_mask()) < 2000
    assert np.count_nonzero(clean != person_mask()) < 40


def test_an_empty_scene_gives_nothing() -> None:
    assert not SilhouetteExtractor(flat(100, 2))(image(100)).any()


def test_a_shadow_is_not_the_person() -> None:
    shadow = image(150, 135)
    assert not SilhouetteExtractor(flat(150, 2))(shadow).any()
    without = BackgroundConfig(shadow=0.0)
    assert np.count_nonzero(SilhouetteExtractor(flat(150, 2), without)(shadow)) > 3000
    # Only what is darker can be a shadow.
    assert np.count_nonzero(SilhouetteExtractor(flat(150, 2))(image(150, 165))) > 3000


@pytest.mark.parametrize("gain", [0.94, 1.06])
def test_a_scene_that_flickers_stays_background(
    gain: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = flat(200, 2)
    extractor = SilhouetteExtractor(model, BackgroundConfig(follow=False))
    got = extractor(image(200 * gain, 100 * gain))
    assert extractor.gain == pytest.approx(gain, abs=1e-6)
    assert np.count_nonzero(got != person_mask()) <= 8
    monkeypatch.setattr(background, "_FLICKER", 0.0)
    rigid = SilhouetteExtractor(model, BackgroundConfig(follow=False, shadow=0.0))
    assert np.all(rigid(image(200 * gain)) == 255)


def test_a_larger_change_than_flicker_is_not_followed() -> None:
    extractor = SilhouetteExtractor(flat(100, 2), BackgroundConfig(follow=False))
    extractor(image(130))
    assert extractor.gain == 1.0


def test_specks_are_dropped_and_persons_kept() -> None:
    made = np.zeros((100, 100), np.uint8)
    made[10:30, 10:30] = 255  # 400 px: 4 %
    made[60:65, 60:65] = 255  # 25 px: 0.25 %
    expected = made.copy()
    expected[60:65, 60:65] = 0
    np.testing.assert_array_equal(clean_silhouette(made, 0.004, 0.0)[0], expected)
    np.testing.assert_array_equal(clean_silhouette(made, 0.0025, 0.0)[0], made)
    assert not clean_silhouette(made, 0.05, 0.0)[0].any()


def test_small_holes_are_filled_and_large_ones_kept() -> None:
    made = np.zeros((100, 100), np.uint8)
    made[10:90, 10:90] = 255
    made[20:40, 20:40] = 0  # between arm and body
    made[60:65, 60:65] = 0  # 25 px
    expected = made.copy()
    expected[60:65, 60:65] = 255
    np.testing.assert_array_equal(clean_silhouette(made, 0.0, 0.0026)[0], expected)
    np.testing.assert_array_equal(clean_silhouette(made, 0.0, 0.0025)[0], made)


def test_cleaning_leaves_its_input() -> None:
    made = np.zeros((50, 50), np.uint8)
    made[25, 25] = 255
    clean_silhouette(made, 0.01, 0.01)
    assert made[25, 25] == 255


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-1.5, 3.0), st.sampled_from([0.0, 0.01, 0.1, 0.6]))
def test_cleaning_in_a_window_gives_the_same(seed: int, rare: float, max_hole: float) -> None:
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (60, 80)), (0, 0), 2.0)
    made = np.where(noise > rare * noise.std(), 255, 0).astype(np.uint8)
    window = window_of(made).grown(2, made.shape)
    cleaned, found = clean_silhouette(made, 0.01, max_hole, window)
    np.testing.assert_array_equal(cleaned, clean_silhouette(made, 0.01, max_hole)[0])
    assert found == window_of(cleaned)
