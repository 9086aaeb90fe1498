"""An outline to stand in is as high as the person."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.initialization.standing import at_height_of
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)


@pytest.mark.parametrize("pitch_rad", [0.0, 0.2])
@pytest.mark.parametrize("hip_height_m", [-0.6, -0.45, -0.35])
def test_the_height_of_the_hips_is_found(hip_height_m: float, pitch_rad: float) -> None:
    body = BodyModel.of(distance_m=2.4, hip_height_m=hip_height_m, camera_pitch_rad=pitch_rad)
    patches = cardbox_patches(body, reference_posture("front"))
    silhouette = render(patches, CAMERA.with_pitch(pitch_rad))
    guess = body.with_values(hip_height_m=-0.5)
    assert at_height_of(silhouette, guess, CAMERA).placement.hip_height_m == pytest.approx(
        hip_height_m, abs=0.03
    )


def test_without_anybody_it_stays() -> None:
    empty = np.zeros((240, 320), np.uint8)
    assert at_height_of(empty, BodyModel(), CAMERA) == BodyModel()
    cut_off = empty.copy()
    cut_off[:100, 100:200] = 255
    assert at_height_of(cut_off, BodyModel(), CAMERA) == BodyModel()
