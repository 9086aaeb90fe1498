"""Images and silhouettes of synthetic people."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.person import SHIRT, SKIN, person_frames
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from lab.experiments.measuring import random_body

BODY = BodyModel.of(hip_height_m=-0.51)
CAMERA = session_camera()


def renderer(
    seed: int = 0, camera: Camera = CAMERA, texture: float = 0.0, noise: float = 0.0
) -> Renderer:
    return Renderer(camera, np.random.default_rng(seed), texture, noise)


def random_camera(rng: np.random.Generator) -> Camera:
    """Of f = 290 to 370 px, up to 5 degrees down: at 2 m hanging arms of `random_body` are seen."""
    focal = rng.uniform(290.0, 370.0)
    pitch_rad = np.radians(rng.uniform(0.0, 5.0))
    return Camera(320, 240, focal, focal, 159.5, 119.5, float(pitch_rad))


def cardbox_silhouette(body: BodyModel, posture: NDArray[np.float64]) -> NDArray[np.uint8]:
    mask = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    for patch in CAMERA.project(CAMERA.reference_to_optical(cardbox_patches(body, posture))):
        cv2.fillPoly(mask, [np.rint(patch).astype(np.int32)], 255)
    return mask


@pytest.mark.parametrize("name", ["front", "side", "arms"])
def test_a_person_resembles_their_cardbox_but_is_none(name: str) -> None:
    posture = reference_posture(name)
    person = renderer().silhouette(BODY, posture) > 0
    # Below the hips there are legs, which the cardbox lacks.
    row = int(CAMERA.project(CAMERA.reference_to_optical(pose(BODY.rigid, posture).hip))[1])
    box = cardbox_silhouette(BODY, posture) > 0
    iou = (person & box)[:row].sum() / (person | box)[:row].sum()
    # Fingers and raised shoulders are not in the cardbox.
    assert 0.75 < iou < 0.97
    assert person[row + 20].any()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), name=st.sampled_from(["front", "side", "arms"]))
def test_every_person_covers_their_skeleton(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    body, camera = random_body(rng), random_camera(rng)
    posture = reference_posture(name)
    silhouette = renderer(camera=camera).silhouette(body, posture)
    assert set(np.unique(silhouette)) == {0, 255}
    frames = person_frames(body, posture)
    inner = np.vstack(
        [person_frames(body, posture).keypoints_m, frames.hip, frames.neck, frames.head]
    )
    u, v = np.rint(camera.project(camera.reference_to_optical(inner))).astype(int).T
    seen = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    assert seen[-3:].all()
    assert np.all(silhouette[v[seen], u[seen]] == 255)


def test_left_is_right_in_the_image() -> None:
    posture = reference_posture("front")
    posture[4] = np.radians(100)
    columns = np.flatnonzero(renderer().silhouette(BODY, posture).any(axis=0))
    assert columns.max() - 160 > 160 - columns.min() + 20


def test_a_silhouette_is_as_large_as_a_finer_one() -> None:
    """At eight times the resolution edges weigh nothing."""
    posture = reference_posture("front")
    fine = renderer(camera=CAMERA.scaled(8 * CAMERA.width, 8 * CAMERA.height))
    area = (fine.silhouette(BODY, posture) > 0).sum() / 64
    assert (renderer().silhouette(BODY, posture) > 0).sum() == pytest.approx(area, rel=0.015)


def test_the_person_stands_out_of_the_wall() -> None:
    view = renderer(texture=8.0)
    empty, none = view.image()
    image, mask = view.image(BODY, reference_posture("front"))
    assert not none.any()
    difference = cv2.absdiff(image, empty)
    inside = cv2.erode(mask, np.ones((3, 3), np.uint8)) > 0
    outside = cv2.dilate(mask, np.ones((3, 3), np.uint8)) == 0
    assert difference[inside].min() > 15
    assert difference[outside].max() == 0


@pytest.mark.parametrize("turn", ["left", "right"])
def test_the_torso_hides_the_far_forearm(turn: str) -> None:
    """Turned aside, with the near arm stretched forwards: what is left to see is the shirt."""
    posture = reference_posture("side", turn)
    far, near = (4, 8) if turn == "left" else (8, 4)
    posture[far] = 0.0
    posture[near + 1] = np.radians(90)
    frames = pose(BODY.rigid, posture)
    arm = frames.left if turn == "left" else frames.right
    u, v = np.rint(CAMERA.project(CAMERA.reference_to_optical(arm.elbow))).astype(int)
    image, mask = renderer().image(BODY, posture)
    assert mask[v + 5, u] == 255
    assert image[v + 5, u] < 0.5 * (SHIRT + SKIN)


def test_the_noise_is_as_told() -> None:
    noisy = renderer(noise=3.0)
    stack = np.array([noisy.image()[0] for _ in range(30)], np.float64)
    assert stack.std(axis=0).mean() == pytest.approx(3.0, rel=0.05)


def test_the_same_generator_gives_the_same_bytes() -> None:
    first, second, other = (
        renderer(seed, noise=3.0).image(BODY, reference_posture("arms"))[0] for seed in (1, 1, 2)
    )
    assert first.tobytes() == second.tobytes()
    assert first.tobytes() != other.tobytes()
