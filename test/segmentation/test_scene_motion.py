"""A person who stands is told from an empty scene; noise and light are not motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.segmentation.scene_motion import SceneMotion

STILL = 0.006
IMAGES = 30


def moved(images: list[Any]) -> float:
    motion = SceneMotion(IMAGES)
    return [motion.add(image) for image in images][-1]


def test_an_empty_scene_is_still(room: Any) -> None:
    assert moved([room.image() for _ in range(IMAGES)]) <= STILL / 2


def test_an_empty_scene_before_a_noisy_camera_is_still(room: Any) -> None:
    rng = np.random.default_rng(3)
    noisy = [room.image() + rng.normal(0, 10, (120, 160)) for _ in range(IMAGES)]
    assert moved([np.clip(image, 0, 255).astype(np.uint8) for image in noisy]) <= STILL


@pytest.mark.parametrize("change", [0.7, 1.3])
def test_light_is_no_motion(room: Any, change: float) -> None:
    gains = [1 + (change - 1) * k / IMAGES for k in range(IMAGES)]
    assert moved([room.image(gain=gain) for gain in gains]) <= STILL


def test_somebody_who_stands_moves(room: Any) -> None:
    assert moved([room.image(80 + 0.4 * (k // 5 % 3)) for k in range(IMAGES)]) > STILL


def test_somebody_who_passes_in_three_images_moves(room: Any) -> None:
    images = [room.image() for _ in range(IMAGES)]
    images[20:23] = [room.image(at) for at in (30, 80, 130)]
    assert moved(images) > STILL


def test_where_it_moves_is_known(room: Any) -> None:
    motion = SceneMotion(IMAGES)
    assert motion.moved is None
    for k in range(IMAGES):
        motion.add(room.image(None if k < 15 else 40))
    assert motion.moved is not None
    assert motion.moved.shape == (60, 80)
    assert motion.moved[:, 15:25].mean() > 0.3
    assert not motion.moved[:, 40:].any()


@pytest.mark.parametrize("images", [2, 3])
def test_a_few_images_are_enough_to_see_somebody_come(room: Any, images: int) -> None:
    motion = SceneMotion(images)
    assert motion.add(room.image()) == 0.0
    assert motion.add(room.image()) < STILL
    assert motion.add(room.image(80)) > STILL
