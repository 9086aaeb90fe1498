"""Colours of the parts, learned from drawn references."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.part_colors import (
    can_learn,
    fit_posture,
    learn_appearance,
    part_labels,
    seen_appearance,
)
from cardbox_tracker.person.appearance import FOREARM, HAND, HEAD, LEGS, TORSO, steps_of_levels
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import ROLL, TORSO_Y, reference_posture

SHIRT, SKIN, SLEEVE = (150, 60, 30), (110, 150, 210), (30, 160, 40)
BODY = BodyModel.of(distance_m=2.0)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)


def drawn(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Image and silhouette of a person in a shirt whose sleeves have another colour."""
    patches = cardbox_patches(BODY, reference_posture(name))
    silhouette = render(patches, CAMERA)
    image = np.full((240, 320, 3), 128, np.uint8)
    image[silhouette > 0] = SHIRT
    for ks, color in (((5, 6), SKIN), ((9, 10, 13, 14), SLEEVE)):
        for k in ks:
            corners = CAMERA.project(CAMERA.reference_to_optical(patches[k]))
            cv2.fillConvexPoly(image, np.round(corners).astype(np.int32), color)
    return image, silhouette


def references() -> tuple[dict[str, list[np.ndarray]], dict[str, np.ndarray]]:
    both = {name: drawn(name) for name in ("front", "arms")}
    return {n: [image] for n, (image, _) in both.items()}, {n: s for n, (_, s) in both.items()}


def color_bin(color: tuple[int, int, int], brightness: np.ndarray) -> int:
    steps = steps_of_levels(brightness, brightness)
    b, g, r = (int(steps[c, level]) for c, level in enumerate(color))
    return (b * 12 + g) * 12 + r


def test_each_part_has_its_colour() -> None:
    images, silhouettes = references()
    appearance = learn_appearance(images, silhouettes, BODY, CAMERA)
    np.testing.assert_allclose(appearance.brightness, SHIRT)
    likeliest = appearance.histograms.argmax(axis=1)
    for part, color in ((TORSO, SHIRT), (HEAD, SKIN), (FOREARM, SLEEVE), (LEGS, SHIRT)):
        assert likeliest[part] == color_bin(color, appearance.brightness)
    # A hand looks half like the end of the arm, half like the face.
    hand = appearance.histograms[HAND]
    shares = [hand[color_bin(color, appearance.brightness)] for color in (SKIN, SLEEVE)]
    assert shares[0] == pytest.approx(shares[1], rel=0.05)
    assert learn_appearance(images, silhouettes, BODY, CAMERA) == appearance


def test_one_image_of_any_posture_teaches_colours_in_more_light_and_in_less() -> None:
    image, silhouette = drawn("arms")
    appearance = seen_appearance(image, silhouette, BODY, CAMERA, reference_posture("arms"))
    assert appearance is not None
    hand = appearance.histograms[HAND]
    in_light = [tuple(int(gain * c) for c in SKIN) for gain in (0.7, 0.85, 1.0, 1.2)]
    unseen = hand[color_bin((200, 30, 30), appearance.brightness)]
    for color in in_light:
        assert hand[color_bin(color, appearance.brightness)] > 100 * unseen
    # Whether forearms are bare is not known from the first image.
    mixture = (hand + appearance.histograms[TORSO]) / 2
    np.testing.assert_allclose(appearance.histograms[FOREARM], mixture, rtol=0.05)


@pytest.mark.parametrize(("aside_m", "roll_rad"), [(0.0, 0.0), (0.04, 0.0), (0.0, 0.09)])
def test_the_posture_really_held_is_found(aside_m: float, roll_rad: float) -> None:
    held = reference_posture("arms")
    held[[4, 8]] += np.radians((-12.0, 8.0))
    held[[TORSO_Y, ROLL]] += aside_m, roll_rad
    silhouette = render(cardbox_patches(BODY, held), CAMERA)
    for seed in range(4):
        off = np.abs(fit_posture(BODY, CAMERA, silhouette, "arms", seed) - held)
        assert np.degrees(off[[4, 8, ROLL]]).max() < 3.0 and off[TORSO_Y] < 0.01


@pytest.mark.parametrize("depth_m", [1e-5, 1e-9, -1e-5, -0.1])
def test_a_hand_at_the_lens_or_behind_it_is_no_error(depth_m: float) -> None:
    posture = reference_posture("front")
    posture[[5, 9]] = np.radians(80.0)

    def hand_depth_m(body: BodyModel) -> float:
        return float(CAMERA.reference_to_optical(pose(body.rigid, posture).keypoints_m)[2, 2])

    distance_m = 1.0 - hand_depth_m(BodyModel.of(distance_m=1.0)) + depth_m
    body = BodyModel.of(distance_m=distance_m)
    assert hand_depth_m(body) == pytest.approx(depth_m, abs=1e-12)
    _, silhouette = drawn("arms")
    labels = part_labels(body, CAMERA, posture, silhouette)
    assert not (labels >= 0)[silhouette == 0].any()


def test_labels_lie_inside_the_outline_and_hands_end_with_it() -> None:
    posture = reference_posture("arms")
    _, silhouette = drawn("arms")
    labels = part_labels(BODY, CAMERA, posture, silhouette)
    assert set(np.unique(labels)) >= {-1, HAND, FOREARM, TORSO, HEAD}
    assert not (labels >= 0)[silhouette == 0].any()
    # With hands cut off by 10 cm, those found move inwards.
    hands = np.nonzero((labels == HAND).any(axis=0))[0]
    shorter = silhouette.copy()
    columns = np.nonzero(silhouette.any(axis=0))[0]
    shorter[:, : columns[0] + 16] = 0
    shorter[:, columns[-1] - 15 :] = 0
    moved = np.nonzero((part_labels(BODY, CAMERA, posture, shorter) == HAND).any(axis=0))[0]
    assert moved[0] > hands[0] + 8
    assert moved[-1] < hands[-1] - 8


def test_images_of_both_references_and_of_one_kind_are_needed() -> None:
    images, silhouettes = references()
    assert can_learn(images, silhouettes)
    grey = [cv2.cvtColor(images["arms"][0], cv2.COLOR_BGR2GRAY)]
    assert can_learn({"front": grey, "arms": grey}, silhouettes)
    for others in (
        {},
        {"front": images["front"]},
        images | {"arms": []},
        images | {"arms": grey},
        {name: [image[0][::2, ::2]] for name, image in images.items()},
    ):
        assert not can_learn(others, silhouettes)
