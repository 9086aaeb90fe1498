"""The rotation of a camera by the background of its images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import angle_of
from cardbox_tracker.measuring.camera_turns import CameraTurns, follow_turns, turning_lens

FloatArray = NDArray[np.float64]

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
# A photograph of a large wall, by a camera with another focal length.
WALL = np.array([(300.0, 0.0, 400.0), (0.0, 300.0, 400.0), (0.0, 0.0, 1.0)])
TIMES_S = np.arange(24) / 24


def wall(seed: int = 0, brightness: float = 1.0) -> NDArray[np.uint8]:
    rng, side = np.random.default_rng(seed), 800
    layers = [rng.uniform(0, 255 / 3, (side // step, side // step)) for step in (8, 16, 64)]
    resized = [cv2.resize(one, (side, side), interpolation=cv2.INTER_CUBIC) for one in layers]
    return np.asarray(np.clip(brightness * sum(map(np.asarray, resized)), 0, 255), np.uint8)


def turned(vector_deg: Sequence[float]) -> FloatArray:
    return np.asarray(cv2.Rodrigues(np.radians(np.array(vector_deg, np.float64)))[0])


def film(
    room: NDArray[np.uint8], matrices: Sequence[FloatArray]
) -> list[tuple[int, NDArray[np.uint8], NDArray[np.uint8]]]:
    """Return images in which somebody walks before a wall, with their silhouettes."""
    frames, rng = [], np.random.default_rng(1)
    for number, matrix in enumerate(matrices):
        image = np.asarray(cv2.warpPerspective(room, matrix, (160, 120)), np.uint8)
        silhouette = np.zeros_like(image)
        silhouette[30:, 55 + number : 80 + number] = 255
        stripes = rng.integers(0, 255, image.shape).astype(np.uint8)
        frames.append((number, np.where(silhouette > 0, stripes, image), silhouette))
    return frames


def views(turns: Sequence[FloatArray]) -> list[FloatArray]:
    return [CAMERA.k @ turn @ np.linalg.inv(WALL) for turn in turns]


def followed(turns: Sequence[FloatArray]) -> CameraTurns:
    found = follow_turns(film(wall(), views(turns)), CAMERA)
    assert found is not None and not found.unknown
    return found


MOTIONS: dict[str, Callable[[float], Sequence[float]]] = {
    "shake": lambda t: (2 * np.sin(12 * t), 2 * np.sin(9 * t), np.sin(7 * t)),
    "pan": lambda t: (0.0, 30 * t, 0.0),
    "pan to the other side, and tilt": lambda t: (5 * t, -30 * t, 2 * t),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_rotation_of_each_image_is_found(motion: str) -> None:
    turns = [turned(MOTIONS[motion](time_s)) for time_s in TIMES_S]
    found = followed(turns)
    away = [angle_of(found.rotations[number] @ turn.T) for number, turn in enumerate(turns)]
    assert np.degrees(max(away)) < 0.05
    assert found.largest_rad == pytest.approx(max(map(angle_of, turns)), abs=1e-3)


@pytest.mark.parametrize(("motion", "guessed"), [("shake", 1.4), ("pan", 0.6)])
def test_the_turns_show_the_lens(motion: str, guessed: float) -> None:
    turns = [turned(MOTIONS[motion](time_s)) for time_s in TIMES_S[::3]]
    frames = [(image, person) for _, image, person in film(wall(), views(turns))]
    other = replace(CAMERA, fx=guessed * CAMERA.fx, fy=guessed * CAMERA.fy)
    found = turning_lens(frames, other)
    assert found is not None
    assert guessed * found[0] == pytest.approx(1.0, abs=0.03)
    assert 0.06 <= found[1] < 0.1


def test_a_camera_that_stands_or_leaves_its_place_shows_no_lens() -> None:
    straight = views([np.eye(3)] * 12)
    aside = [np.array([(1.0, 0.0, -4.0 * k), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]) for k in range(12)]
    moved = [shift @ view for shift, view in zip(aside, straight, strict=True)]
    for matrices in (straight, moved):
        frames = [(image, person) for _, image, person in film(wall(), matrices)]
        assert turning_lens(frames, CAMERA) is None


def test_the_background_continues_the_first_image_without_the_person() -> None:
    found = followed([turned((0.0, 30 * time_s, 0.0)) for time_s in TIMES_S])
    there = CAMERA.k
    there[:2, 2] -= found.corner_px
    height, width = found.background.shape
    room = cv2.warpPerspective(wall(), there @ np.linalg.inv(WALL), (width, height))
    shows = cv2.erode((found.background > 0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert width > 1.5 * CAMERA.width and shows.mean() > 0.5
    assert np.abs(found.background.astype(float) - room)[shows].mean() < 3.0


def test_a_change_of_the_light_does_not_turn_the_camera() -> None:
    turns = [turned((0.0, 10 * time_s, 0.0)) for time_s in TIMES_S]
    bright, dark = film(wall(), views(turns)), film(wall(brightness=0.7), views(turns))
    found = follow_turns(bright[:15] + dark[15:], CAMERA)
    assert found is not None and not found.unknown
    assert np.degrees(angle_of(found.rotations[23] @ turns[23].T)) < 0.1


def test_parallax_and_a_bare_wall_show_no_rotation() -> None:
    # A near wall passes before a far one.
    aside = [np.array([(1.0, 0.0, -8.0 * k), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]) for k in range(12)]
    straight = views([np.eye(3)] * 12)
    far = film(wall(), straight)
    near = film(wall(5), [shift @ view for shift, view in zip(aside, straight, strict=True)])
    both = [
        (stamp, np.where(np.arange(120)[:, None] % 60 < 30, one, other).astype(np.uint8), person)
        for (stamp, one, person), (_, other, _) in zip(far, near, strict=True)
    ]
    assert follow_turns(both, CAMERA) is None
    assert follow_turns(film(np.full_like(wall(), 120), straight), CAMERA) is None


def test_a_view_that_is_too_far_from_the_first_is_not_known() -> None:
    turns = [turned((0.0, 60 * time_s, 0.0)) for time_s in TIMES_S]
    assert follow_turns(film(wall(), views(turns)), CAMERA) is None


def test_images_of_something_else_have_no_rotation() -> None:
    turns = [turned((0.0, 10 * time_s, 0.0)) for time_s in TIMES_S]
    frames, other = film(wall(), views(turns)), film(wall(7), views(turns))
    frames[10:13] = other[10:13]
    found = follow_turns(frames, CAMERA)
    assert found is not None and found.unknown == 3
    assert set(found.rotations) == set(range(24)) - {10, 11, 12}
    assert np.degrees(angle_of(found.rotations[23] @ turns[23].T)) < 0.1
