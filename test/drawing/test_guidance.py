"""What a person is to do is drawn where they can follow it."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.kinematics import keypoints_m
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import REFERENCE_NAMES, reference_posture
from cardbox_tracker.drawing.guidance import WANTED_BGR, draw_guidance
from cardbox_tracker.estimation.initialization.guidance import instruction
from cardbox_tracker.vision.camera import Camera

BODY = BodyModel()
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
EMPTY = np.zeros((240, 320), np.uint8)


def wanted(image: np.ndarray) -> np.ndarray:
    return np.abs(image.astype(int) - WANTED_BGR).max(axis=2) < 30


@pytest.mark.parametrize("scale", [1, 2])
@pytest.mark.parametrize("name", REFERENCE_NAMES)
def test_outline_surrounds_the_wanted_posture(name: str, scale: int) -> None:
    posture = reference_posture(name)
    image = draw_guidance(EMPTY, BODY, CAMERA, posture, instruction(name, "left"), scale=scale)
    assert image.shape == (240 * scale, 320 * scale, 3)
    rows, columns = np.nonzero(wanted(image))
    view = CAMERA.scaled(320 * scale, 240 * scale)
    pixels = view.project(view.reference_to_optical(keypoints_m(BODY, posture)))
    assert columns.min() < pixels[:, 0].min()
    assert columns.max() > pixels[:, 0].max()
    assert rows.min() < pixels[:, 1].min()


@pytest.mark.parametrize("name", REFERENCE_NAMES)
@pytest.mark.parametrize("number", [1, 60])
def test_text_keeps_within_the_image_and_off_the_person(name: str, number: int) -> None:
    posture = reference_posture(name)
    words = instruction(name, "right")
    with_text = draw_guidance(EMPTY, BODY, CAMERA, posture, words, number)
    without = draw_guidance(EMPTY, BODY, CAMERA, posture, "", None)
    changed = np.any(with_text != without, axis=2)
    assert changed.any()
    # Nothing is cut off at the edges.
    assert not changed[:, 0].any()
    assert not changed[:, -1].any()
    assert not changed[0].any()
    # The person's outline stays as it is.
    assert np.count_nonzero(changed & wanted(without)) == 0


def test_the_number_can_be_left_out() -> None:
    posture = reference_posture("front")
    images = [draw_guidance(EMPTY, BODY, CAMERA, posture, "go", n) for n in (None, 3, 4)]
    assert np.any(images[0] != images[1])
    assert np.any(images[1] != images[2])


def test_words_are_written_over_a_white_image_too() -> None:
    white = np.full((240, 320), 255, np.uint8)
    posture = reference_posture("front")
    written = draw_guidance(white, BODY, CAMERA, posture, "face the camera")
    assert written[:20].min() < 100
    assert np.all(white == 255)
