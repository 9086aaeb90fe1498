"""Cuts of a film, and what is none: people, light, a flash, a camera that moves."""

from __future__ import annotations

import cv2
import numpy as np

from cardbox_tracker.recordings.cuts import Turns, with_cuts


def room(seed: int, column: int = 0) -> np.ndarray:
    """A room of patches, seen from a column of it on, with noise."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(40, 200, (8, 16), np.uint8)
    whole = cv2.resize(patches, (640, 240), interpolation=cv2.INTER_CUBIC)
    seen = np.repeat(whole[:, column : column + 320, None], 3, axis=2)
    return np.clip(seen + np.random.default_rng().normal(0.0, 3.0, seen.shape), 0, 255)


def cuts(images: list[np.ndarray]) -> list[int]:
    given = (np.asarray(one, np.uint8) for one in images)
    return [
        number for number, (_, is_cut) in enumerate(with_cuts(given, lambda one: one)) if is_cut
    ]


def test_each_shot_begins_with_a_cut() -> None:
    film = [room(1)] * 4 + [room(2)] * 3 + [room(1)] * 2
    assert cuts(film) == [4, 7]
    assert cuts([one[..., 0] for one in film]) == [4, 7]


def test_an_image_that_is_damaged_or_a_flash_is_no_cut() -> None:
    flash, damaged = np.full((240, 320, 3), 255.0), room(3)
    assert cuts([room(1), room(1), flash, room(1), damaged, room(1), room(1), damaged]) == []


def test_light_that_is_switched_on_is_no_cut() -> None:
    assert cuts([room(1) * 0.4] * 3 + [room(1)] * 3) == []


def test_a_camera_that_pans_is_not_cut() -> None:
    # Most of the image changes each time.
    assert cuts([room(1, 40 * k) for k in range(8)]) == []


def test_somebody_who_walks_close_by_is_no_cut() -> None:
    film = []
    for k in range(12):
        image = room(1)
        image[:, max(30 * k - 150, 0) : 30 * k] = 20
        film.append(image)
    assert cuts(film) == []


def test_all_images_are_given_once() -> None:
    assert [one for one, _ in with_cuts(range(5), lambda k: np.full((9, 9), k, np.uint8))] == [
        *range(5)
    ]
    assert list(with_cuts([], lambda one: one)) == []


def take_turns(images: list[np.ndarray]) -> list[bool]:
    turns = Turns()
    return [turns.see(np.asarray(one, np.uint8)) for one in images]


def test_two_cameras_on_one_topic_are_told_within_two_dozen_images() -> None:
    told = take_turns([room(1 + number % 2) for number in range(24)])
    assert not any(told[:16]) and all(told[20:])


def test_one_camera_does_not_take_turns() -> None:
    still, pan = [room(1)] * 30, [room(1, 10 * k) for k in range(32)]
    light = [room(1) * (0.4 if k % 2 else 1.0) for k in range(30)]
    shots = [room(1 + k // 5) for k in range(30)]
    flashes = [np.full((240, 320, 3), 255.0) if k % 5 == 0 else room(1) for k in range(30)]
    for film in (still, pan, light, shots, flashes):
        assert not any(take_turns(film))
