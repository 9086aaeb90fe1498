"""Postures that an estimate stands for have its mean, its deviations, and the joints' limits."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TURNING_LIMITS, reference_posture
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.search.particles import normal_postures
from cardbox_tracker.tracking.estimate import LOST, Estimate
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.51)
COUNT = 4000


def assert_within_limits(postures: np.ndarray) -> None:
    assert (postures >= TURNING_LIMITS[:, 0]).all()
    assert (postures <= TURNING_LIMITS[:, 1]).all()


def test_normal_postures_have_mean_and_deviation() -> None:
    mean, stddev = reference_posture("front"), np.full(12, 0.02)
    drawn = normal_postures(mean, stddev, COUNT, np.random.default_rng(1))
    assert drawn.shape == (COUNT, 12)
    assert np.abs(drawn.mean(axis=0) - mean).max() < 0.003
    assert drawn.std(axis=0) == pytest.approx(stddev, rel=0.15)
    wide = normal_postures(mean, np.full(12, 5.0), COUNT, np.random.default_rng(1))
    assert_within_limits(wide)


@pytest.mark.parametrize("preset", PRESETS)
def test_samples_spread_as_the_estimate_says_and_change_nothing(preset: str) -> None:
    def run(asks: bool) -> Estimate:
        tracker = Tracker(BODY, CAMERA, PRESETS[preset](), np.random.default_rng(0))
        for i in range(4):
            estimate = tracker.track(render(cardbox_patches(BODY, wave(i / 15.0)), CAMERA))
            if asks:
                drawn = tracker.sample(estimate, COUNT, np.random.default_rng(1))
                assert drawn.shape == (COUNT, 12)
                assert_within_limits(drawn)
        if asks:
            assert estimate.posture is not None and estimate.posture_stddev is not None
            off = np.abs(drawn.mean(axis=0) - estimate.posture) / estimate.posture_stddev
            assert off.max() < 1.0  # a limit may cut one side off
            ratio = drawn.std(axis=0) / estimate.posture_stddev
            assert (ratio < 1.2).all()
            assert np.median(ratio) > 0.7
        return estimate

    silent, asked = run(False), run(True)
    np.testing.assert_array_equal(silent.posture, asked.posture)


def test_without_a_posture_there_is_nothing_to_draw() -> None:
    tracker = Tracker(BODY, CAMERA)
    with pytest.raises(ValueError, match="no posture"):
        tracker.sample(Estimate(LOST), 10, np.random.default_rng(0))
