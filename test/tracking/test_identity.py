"""Whether somebody is the person of the images before: places, clothes, and the tracker."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.detectors.identity import OTHER, Identity, apart, unlike
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TORSO_Y, reference_posture
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import LOST, TRACKING
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.6, hip_height_m=-0.25)
RED, BLUE = (40, 40, 220), (220, 60, 40)
STEP_NS = 66_666_667
CLOTHES, OTHERS = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def figure(column: float) -> Figure:
    """A trunk of 100 px, which is half a metre."""
    at = {"shoulder": (20.0, -50.0), "hip": (15.0, 50.0)}
    sides = ("left", 1.0), ("right", -1.0)
    return Figure(
        {f"{s}_{n}": np.array([column + k * u, v]) for n, (u, v) in at.items() for s, k in sides}
    )


@given(st.floats(0.0, 3.0), st.floats(0.01, 1.4), st.booleans())
def test_nobody_runs_faster_than_4_metres_a_second(
    moved_m: float, away_s: float, is_alike: bool
) -> None:
    identity = Identity()
    for number in range(6):
        assert identity.is_same(figure(0.0), CLOTHES, number * STEP_NS)
    now_ns = 5 * STEP_NS + round(1e9 * away_s)
    found = identity.is_same(figure(200.0 * moved_m), CLOTHES if is_alike else OTHERS, now_ns)
    if abs(moved_m - 0.2 - 4.0 * away_s) > 1e-3:
        assert found == (moved_m < 0.2 + 4.0 * away_s)


def test_who_was_away_is_known_by_the_clothes_until_the_scene_was_empty() -> None:
    identity = Identity()
    for number in range(6):
        identity.is_same(figure(0.0), CLOTHES, number * STEP_NS)
    assert not identity.is_same(figure(0.0), OTHERS, 5_000_000_000)
    assert identity.is_same(figure(900.0), CLOTHES, 5_100_000_000)
    identity.nobody(65_200_000_000)
    assert identity.is_same(figure(0.0), OTHERS, 65_300_000_000)


@pytest.mark.parametrize(("distance", "is_alike"), [(0.5, True), (0.7, False)])
def test_colours_as_far_apart_as_0_6_tell_the_same_person(distance: float, is_alike: bool) -> None:
    """One person's are 0.1 to 0.4 apart, those of different clothes 0.8 to 1."""
    share = (1.0 - distance**2) ** 2
    colours = np.array([share, 1.0 - share])
    assert apart(CLOTHES, colours) == pytest.approx(distance)
    identity = Identity()
    for number in range(6):
        identity.is_same(figure(0.0), CLOTHES, number * STEP_NS)
    assert identity.is_same(figure(0.0), colours, 5_000_000_000) == is_alike
    assert (unlike(None, CLOTHES, None, colours, 0) < OTHER) == is_alike


@pytest.mark.parametrize(("away_s", "expected"), [(0.0, 4.0), (0.5, 4.0 / 9.0), (1.0, 4.0 / 25.0)])
def test_a_place_is_less_sure_by_2_lengths_of_the_trunk_a_second(
    away_s: float, expected: float
) -> None:
    """Half a metre aside is one length of the trunk; at first, half of one is a deviation of 1."""
    found = unlike(figure(0.0), CLOTHES, figure(100.0), CLOTHES, round(1e9 * away_s))
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("has_image", [True, False])
def test_points_of_somebody_else_are_lost_and_the_person_comes_back(
    detected: Callable[..., ImagePoints], has_image: bool
) -> None:
    tracker, states = Tracker(BODY, CAMERA, default_preset()), []
    # The detector hops to somebody in other clothes for a second.
    for number in range(30):
        is_other = 8 <= number < 20
        state = np.zeros(14)
        state[:12] = reference_posture("front")
        state[TORSO_Y] = 0.7 if is_other else -0.7
        shown = render(cardbox_patches(BODY, state[:12]), CAMERA) > 0
        image = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
        image[shown] = BLUE if is_other else RED
        silhouette = np.where(shown, np.uint8(255), np.uint8(0))
        points = detected(BODY, CAMERA, state)
        seen = Observation(
            silhouette, image if has_image else None, points=points, stamp_ns=number * STEP_NS
        )
        states.append(tracker.track(seen).state)
    assert states[5] == states[-1] == TRACKING
    # Without an image, only the speed tells: 1.4 m take 0.3 s.
    assert set(states[8 : 20 if has_image else 12]) == {LOST}
