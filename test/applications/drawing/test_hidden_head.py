"""The head of the tracked person cannot be recognized, and the rest of the image is unchanged."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.applications.drawing.overlay import with_hidden_head
from cardbox_tracker.body.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.body.proportions import body_from_proportions
from cardbox_tracker.detection.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.estimation.estimate import NO_PERSON, TRACKING, Estimate
from cardbox_tracker.vision.camera import Camera

BODY = body_from_proportions(1.75, 2.0)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
# Every pixel differs from its neighbours.
NOISE = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)


def hidden(estimate: Estimate, points: ImagePoints | None = None) -> np.ndarray:
    """Return which pixels (H, W) of noise were changed."""
    drawn = with_hidden_head(NOISE, BODY, CAMERA, estimate, points)
    assert drawn.shape == NOISE.shape
    return np.asarray((drawn != NOISE).any(axis=2))


def head_px(posture: np.ndarray) -> np.ndarray:
    """Return the pixels (n, 2) of the corners of the model's head."""
    patches = cardbox_patches(BODY, posture)[[PATCH_NAMES.index("head_frontal")]]
    return CAMERA.project(CAMERA.reference_to_optical(patches)).reshape(-1, 2)


@pytest.mark.parametrize("pitch_rad", [0.0, 0.6])
def test_the_head_becomes_coarse(pitch_rad: float) -> None:
    posture = np.zeros(12)
    posture[2] = pitch_rad
    changed = hidden(Estimate(TRACKING, posture))
    (left, top), (right, bottom) = head_px(posture).min(axis=0), head_px(posture).max(axis=0)
    inside = changed[max(0, int(top)) : int(bottom), int(left) : int(right)]
    assert inside.mean() > 0.95
    assert not changed[200:].any()
    assert changed.mean() < 0.25


def test_few_colours_remain() -> None:
    drawn = with_hidden_head(NOISE, BODY, CAMERA, Estimate(TRACKING, np.zeros(12)))
    changed = (drawn != NOISE).any(axis=2)
    assert len(np.unique(drawn[changed], axis=0)) <= 60
    assert (np.random.default_rng(0).integers(0, 256, NOISE.shape, np.uint8) == NOISE).all()


def test_the_points_of_a_face_are_hidden_too() -> None:
    px = np.full((len(POINT_NAMES), 2), np.nan)
    px[POINT_NAMES.index("nose")] = 290.0, 40.0
    points = ImagePoints(px, np.where(np.isfinite(px[:, 0]), 0.9, 0.0))
    near_the_point = np.s_[35:46, 285:296]
    estimate = Estimate(TRACKING, np.zeros(12))
    assert not hidden(estimate)[near_the_point].any()
    assert hidden(estimate, points)[near_the_point].mean() > 0.95


def test_an_unknown_head_hides_everything() -> None:
    assert hidden(Estimate(NO_PERSON)).mean() > 0.95
