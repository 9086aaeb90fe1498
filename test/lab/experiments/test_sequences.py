"""The figure of a sequence."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS
from lab.experiments.sequences import draw_estimate

CAMERA = Camera(160, 120, 80.0, 80.0, 79.5, 59.5)


def test_a_patch_half_behind_the_camera_is_drawn_as_far_as_it_is_seen() -> None:
    body = BodyModel.of(distance_m=0.5)
    posture = np.zeros(N_JOINTS)
    posture[2] = 0.8  # the trunk is bent past the camera
    drawn = np.any(draw_estimate(body, CAMERA, posture) != 255, axis=2)
    exact = render(cardbox_patches(body, posture), CAMERA) > 0
    assert exact.any()
    assert np.all(drawn[exact])
    assert np.count_nonzero(drawn & ~exact) < 0.05 * np.count_nonzero(exact)


def test_an_estimate_of_nobody_is_white() -> None:
    assert np.all(draw_estimate(BodyModel(), CAMERA, np.full(N_JOINTS, np.nan)) == 255)
