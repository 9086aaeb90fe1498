"""Bare forearms or sleeves: the chance by hand, and a drawn person of either kind."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.part_colors import seen_appearance
from cardbox_tracker.person.appearance import FOREARM, HAND, TORSO
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import PROPORTIONS, BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.terms.inner_cue import InnerCue, InnerCueTerm, Sleeves, forearm_of
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import Frame, Posed

SHIRT, SKIN, WALL = (150, 60, 30), (110, 150, 210), (128, 128, 128)
BODY = BodyModel.of(distance_m=2.0)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
ARMS = reference_posture("arms")
FOREARMS = 9, 10, 13, 14  # patches


def sleeves() -> Sleeves:
    return Sleeves(np.eye(5), forearm_of(BODY), 330.0 / 2.0)


def posed(posture: np.ndarray) -> Posed:
    return Posed(body_tuple(BODY, CAMERA), np.append(posture, [0.0, 0.0])[None])


def everywhere(nats: float) -> np.ndarray:
    return np.full((2000, 320), nats, np.float32)  # beyond the image, so that no arm leaves it


def test_forearms_are_a_mixture_of_skin_and_shirt() -> None:
    worn = sleeves()
    forearm = worn.histograms[FOREARM]
    assert forearm[HAND] == pytest.approx(worn.bare) == pytest.approx(1 / (1 + np.exp(-1.0)))
    assert forearm[TORSO] == pytest.approx(1 - worn.bare)
    assert worn.hand_weight == pytest.approx(1 - worn.bare / 2)


@pytest.mark.parametrize("nats", [2.0, -1.5])
def test_an_image_adds_its_evidence(nats: float) -> None:
    worn = sleeves()
    worn.see(everywhere(nats), (0, 0), posed(np.zeros(12)))
    # Two hanging forearms, whose patch has 0.7 of the width and 0.72 of the length.
    gained = 2 * 0.1 * (nats + 0.2) * 0.7 * 0.72
    assert worn.log_odds == pytest.approx(1.0 + gained)


@pytest.mark.parametrize("nats", [2.5, -2.5])
def test_the_chance_is_never_certain(nats: float) -> None:
    worn = sleeves()
    for _ in range(100):
        worn.see(everywhere(nats), (0, 0), posed(np.zeros(12)))
    assert worn.log_odds == pytest.approx(np.sign(nats) * 3.0)
    assert 0.04 < worn.bare < 0.96


def test_colours_that_look_alike_are_no_evidence() -> None:
    worn = sleeves()
    before = worn.histograms
    assert not worn.see(everywhere(0.0), (0, 0), posed(np.zeros(12)))
    np.testing.assert_array_equal(worn.histograms, before)


def drawn(color: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Image and silhouette of a person in the posture ``arms`` with forearms of a colour."""
    patches = cardbox_patches(BODY, ARMS)
    silhouette = render(patches, CAMERA)
    image = np.full((240, 320, 3), WALL, np.uint8)
    image[silhouette > 0] = SHIRT
    for ks, painted in (((5, 6), SKIN), (FOREARMS, color)):
        for k in ks:
            corners = CAMERA.project(CAMERA.reference_to_optical(patches[k]))
            cv2.fillConvexPoly(image, np.round(corners).astype(np.int32), painted)
    return image, silhouette


@pytest.mark.parametrize("is_bare", [True, False])
def test_forearms_of_a_person_are_recognized_within_a_few_seconds(is_bare: bool) -> None:
    image, silhouette = drawn(SKIN if is_bare else SHIRT)
    body = BODY.with_values(source=PROPORTIONS)
    seen = seen_appearance(image, silhouette, body, CAMERA, ARMS)
    term = InnerCue().build(body.with_values(appearance=seen), CAMERA)
    assert isinstance(term, InnerCueTerm)
    assert term._sleeves is not None
    channels = {"silhouette": silhouette, "image": image}
    frame = Frame(CAMERA, channels, 240, int(np.count_nonzero(silhouette)), posed(ARMS))
    for _ in range(45):
        term.observe(frame)
    assert term._sleeves.bare > 0.9 if is_bare else term._sleeves.bare < 0.1


def test_a_measured_persons_sleeves_are_known() -> None:
    image, silhouette = drawn(SKIN)
    appearance = seen_appearance(image, silhouette, BODY, CAMERA, ARMS)
    term = InnerCue().build(BODY.with_values(appearance=appearance), CAMERA)
    assert isinstance(term, InnerCueTerm)
    assert term._sleeves is None
