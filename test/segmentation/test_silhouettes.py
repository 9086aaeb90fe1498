"""Resize, rectify, learn, cut out: one object for live images and recordings."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

K = np.array([(600.0, 0, 31.5), (0, 600.0, 23.5), (0, 0, 1)])
BENT = np.array([-0.3, 0.12, 0.001, -0.002, 0.0])
PLAIN = BackgroundConfig(learn_images=3, clean_up=False)


def calibration(distortion: np.ndarray | None = None) -> Calibration:
    return Calibration(64, 48, K, np.zeros(5) if distortion is None else distortion)


def pipeline(config: BackgroundConfig = PLAIN) -> SilhouettePipeline:
    return SilhouettePipeline(calibration(), (32, 24), config)


def level(value: int) -> np.ndarray:
    return np.full((24, 32), value, np.uint8)


def test_images_come_out_at_the_working_size_grey_or_in_colour() -> None:
    made = pipeline()
    assert (made.camera.width, made.camera.height, made.camera.fx) == (32, 24, 300.0)
    # Each pixel is the mean of four: 10, 20, 30 and 40 make 25.
    grey = np.tile(np.array([(10, 20), (30, 40)], np.uint8), (24, 32))
    np.testing.assert_array_equal(made.prepare(grey), level(25))
    colour = np.dstack([grey, grey + 100, grey])
    np.testing.assert_array_equal(made.prepare(colour)[0, 0], (25, 125, 25))


@given(arrays(np.uint8, (48, 64)))
def test_a_distorted_image_is_resized_then_rectified(image: np.ndarray) -> None:
    bent = calibration(BENT)
    small = cv2.resize(image, (32, 24), interpolation=cv2.INTER_AREA)
    rectify = bent.rectifier(32, 24)
    assert rectify is not None
    prepared = SilhouettePipeline(bent, (32, 24)).prepare(image)
    np.testing.assert_array_equal(prepared, rectify(small))


def test_a_camera_without_calibration_is_refused() -> None:
    with pytest.raises(CameraError, match="not calibrated"):
        SilhouettePipeline(Calibration(64, 48, np.zeros((3, 3)), np.zeros(5)), (32, 24))


def test_it_learns_then_cuts_out_by_hand() -> None:
    made = pipeline()
    for count, value in enumerate((96, 100, 104)):
        assert made.learning.count == count
        assert not made.learning.has_enough() and not made.is_ready
        made.learning.add(level(value))
    assert made.learning.has_enough() and not made.is_ready and made.model is None
    with pytest.raises(RuntimeError, match="background"):
        made.silhouette(level(100))
    assert made.drift(level(100)) == 0.0
    model = made.finish_learning()
    assert made.model is model and made.is_ready
    # Mean 100, standard deviation 4: foreground from 2 x 4 grey levels on.
    np.testing.assert_allclose((model.mean[0, 0], model.stddev[0, 0]), (100, 4))
    image = level(107)
    image[:, :4] = 108
    assert np.count_nonzero(made.silhouette(image)) == 24 * 4
    assert made.drift(image) == 7.0


def test_other_settings_keep_what_was_learned() -> None:
    made = pipeline()
    for value in (96, 100, 104):
        made.learning.add(level(value))
    model = made.finish_learning()
    made.config = BackgroundConfig(clean_up=False, threshold=3.0)
    assert made.model is model
    assert not made.silhouette(level(111)).any()
    assert made.silhouette(level(112)).all()


def test_settings_changed_while_learning_hold_afterwards() -> None:
    made = pipeline()
    made.learning.add(level(96))
    made.learning.add(level(104))
    made.config = BackgroundConfig(learn_images=2, clean_up=False, threshold=0.5)
    assert made.learning.has_enough()
    made.finish_learning()
    # Mean 100, standard deviation sqrt(32): foreground from 2.83 grey levels on.
    assert not made.silhouette(level(102)).any()
    assert made.silhouette(level(103)).all()


def test_relearning_forgets() -> None:
    made = pipeline()
    for value in (96, 100, 104):
        made.learning.add(level(value))
    made.finish_learning()
    made.relearn()
    assert (made.learning.count, made.is_ready) == (0, False)
    for _ in range(3):
        made.learning.add(level(200))
    made.finish_learning()
    assert not made.silhouette(level(200)).any()
    assert made.silhouette(level(100)).all()


@pytest.mark.parametrize("count", [0, 1])
def test_too_few_images_are_no_background(count: int) -> None:
    made = pipeline()
    for _ in range(count):
        made.learning.add(level(100))
    with pytest.raises(ValueError, match=f"{count} images"):
        made.finish_learning()
    assert not made.is_ready


@given(st.lists(arrays(np.uint8, (24, 32)), min_size=2, max_size=4), arrays(np.uint8, (24, 32)))
def test_it_is_the_background_model_of_the_prepared_images(
    scene: list[np.ndarray], image: np.ndarray
) -> None:
    made, learner = pipeline(BackgroundConfig()), BackgroundLearner()
    for one in scene:
        made.learning.add(made.prepare(one))
        learner.add(one)
    made.finish_learning()
    expected = SilhouetteExtractor(learner.model())(image)
    np.testing.assert_array_equal(made.silhouette(made.prepare(image)), expected)
