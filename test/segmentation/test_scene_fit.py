"""A scene is recognised with a person in it and in other light; a moved camera is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.kept_background import SceneFit, compare_scene


def model_of(room: Any) -> BackgroundModel:
    learner = BackgroundLearner()
    for _ in range(10):
        learner.add(room.image())
    return learner.model()


@pytest.mark.parametrize("gain", [0.7, 1.0, 1.4])
@pytest.mark.parametrize("at", [None, 30.0, 80.0])
def test_the_scene_is_recognised(room: Any, gain: float, at: float | None) -> None:
    fit = compare_scene(model_of(room), room.image(at, gain=gain))
    assert fit.is_same and not fit.is_moved
    assert "places" in str(fit)


@pytest.mark.parametrize("shift", [(2, 0), (3, 0), (0, -3), (4, 2)])
@pytest.mark.parametrize("at", [None, 80.0])
def test_a_moved_camera_is_found_with_its_shift(
    room: Any, shift: tuple[int, int], at: float | None
) -> None:
    fit = compare_scene(model_of(room), room.image(at, shift=shift))
    assert fit.is_moved and not fit.is_same
    assert fit.shift_px == pytest.approx(shift, abs=1)
    assert "moved" in str(fit)


def test_a_shift_of_a_pixel_is_none(room: Any) -> None:
    assert compare_scene(model_of(room), room.image(shift=(1, 0))).is_same


@pytest.mark.parametrize(
    ("tiles", "in_place", "changed", "is_same"),
    [(10, 3, 1.0, True), (10, 2, 0.0, False), (4, 0, 0.0, False), (3, 0, 0.4, True)],
)
def test_three_tenths_of_the_places_decide_if_there_are_four(
    tiles: int, in_place: int, changed: float, is_same: bool
) -> None:
    assert SceneFit(tiles, in_place, 0, (0, 0), changed).is_same is is_same


def test_another_room_is_refused(room: Any) -> None:
    other = type(room)(99)
    assert not compare_scene(model_of(room), other.image()).is_same


def test_without_texture_the_brightness_decides() -> None:
    shape = (120, 160)
    model = BackgroundModel(np.full(shape, 100, np.float32), np.full(shape, 2, np.float32))
    image = np.full(shape, 120, np.uint8)
    image[:, :50] = 220
    fit = compare_scene(model, image)
    assert fit.tiles == 0 and fit.is_same
    image[:, :70] = 220
    fit = compare_scene(model, image)
    assert not fit.is_same and "44 %" in str(fit)
