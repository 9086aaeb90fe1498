"""The colour of the asked outline says what the capture will say."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.asked_outline import FAR, FITS, NEARLY, LiveFit
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.person.proportions import sizes_of_stature

CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
CONFIG = InitializationConfig(2.0, camera_pitch_rad=0.1)
FIT = LiveFit(CAMERA, CONFIG)


def seen(posture: np.ndarray, stature_m: float = 1.68, aside_m: float = 0.0) -> np.ndarray:
    posture = posture.copy()
    posture[0] = aside_m
    sizes = sizes_of_stature(stature_m)
    body = BodyModel.of(sizes, distance_m=2.0, hip_height_m=-0.55, camera_pitch_rad=0.1)
    return render(cardbox_patches(body, posture), CAMERA.with_pitch(0.1))


@pytest.mark.parametrize("stature_m", [1.42, 1.68, 1.94])
@pytest.mark.parametrize("name", REFERENCE_NAMES)
def test_only_the_posture_that_is_held_fits(name: str, stature_m: float) -> None:
    silhouette = seen(reference_posture(name), stature_m, aside_m=0.25)
    found = {other: FIT(other, silhouette) for other in REFERENCE_NAMES}
    assert found == {other: FITS if other == name else FAR for other in REFERENCE_NAMES}


def test_arms_that_rise_become_amber_and_green() -> None:
    start, end = reference_posture("front"), reference_posture("arms")
    found = [FIT("arms", seen(start + part * (end - start))) for part in np.linspace(0, 1, 12)]
    ranks = [(FAR, NEARLY, FITS).index(fit) for fit in found]
    assert ranks == sorted(ranks)
    assert set(ranks) == {0, 1, 2}


def test_nobody_fits_nothing() -> None:
    assert [FIT(name, np.zeros((240, 320), np.uint8)) for name in REFERENCE_NAMES] == [FAR] * 3
