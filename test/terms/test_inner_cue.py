"""The cue inside the outline: ratios, zones, areas and signs by hand, and an arm that is found."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.measuring.part_colors import learn_appearance
from cardbox_tracker.person.appearance import PARTS, TORSO, UNSEEN, Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.inner_cue import (
    ArmGains,
    InnerCue,
    InnerCueObservation,
    InnerCueTerm,
    arms_in_image,
    forearm_of,
    ratios_of,
    zones_of,
)
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import ARM, ARMS, TRUNK, Frame, Posed, TermObservation
from cardbox_tracker.tracking.tracker import Tracker

SHIRT, SKIN, TROUSERS, WALL = (150, 60, 30), (110, 150, 210), (40, 40, 40), (128, 128, 128)
BODY = BodyModel.of(distance_m=2.0)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
FRONT = reference_posture("front")


def before_the_torso() -> np.ndarray:
    """The left forearm lies before the belly."""
    posture = reference_posture("front")
    posture[4:8] = np.radians((20, 30, -70, 40))
    return posture


def drawn(posture: np.ndarray, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Image and silhouette of a person with bare forearms."""
    patches = cardbox_patches(BODY, posture)
    silhouette = render(patches, CAMERA)
    image = np.full((240, 320, 3), WALL, np.uint8)
    image[silhouette > 0] = SHIRT
    for k in (5, 6, 9, 10, 13, 14):  # head and forearms
        corners = CAMERA.project(CAMERA.reference_to_optical(patches[k]))
        cv2.fillConvexPoly(image, np.round(corners).astype(np.int32), SKIN)
    noise = np.random.default_rng(0).normal(0, 3, image.shape)
    return np.clip(image * gain + noise, 0, 255).astype(np.uint8), silhouette


def grey(image: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def measured(is_grey: bool = False) -> BodyModel:
    """The body with its colours learned from drawn references."""
    images, silhouettes = {}, {}
    for name in ("front", "arms"):
        image, silhouettes[name] = drawn(reference_posture(name))
        images[name] = [grey(image) if is_grey else image]
    return BODY.with_values(appearance=learn_appearance(images, silhouettes, BODY, CAMERA))


POSABLE = body_tuple(BODY.rigid, CAMERA)


def states(postures: Any) -> np.ndarray:
    """Postures (N, 12) or states (N, 14) as states."""
    whole = np.zeros((len(postures), 14))
    whole[:, : np.shape(postures)[1]] = postures
    return whole


def frame(image: Any, silhouette: np.ndarray, posture: Any = FRONT) -> Frame:
    channels = {"silhouette": silhouette} | ({} if image is None else {"image": image})
    before = None if posture is None else Posed(POSABLE, states([posture]))
    return Frame(CAMERA, channels, 240, int(np.count_nonzero(silhouette)), before)


def whole(seen: TermObservation, postures: Any) -> np.ndarray:
    return seen.rate(Posed(POSABLE, states(postures)))


def beside(seen: TermObservation, torso: Any, side: str, arms: Any) -> np.ndarray:
    """Costs of arms beside a torso, (4,) or (6,) with the place."""
    placed = np.zeros((len(arms), 14))
    placed[:, :4], placed[:, 12 : 8 + len(torso)] = torso[:4], torso[4:]
    placed[:, ARMS[side]] = arms
    return seen.rate(Posed(POSABLE, placed, ARM[side == "right"]))


@pytest.mark.parametrize("is_grey", [False, True])
@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_a_forearm_before_the_torso_is_found(is_grey: bool, gain: float) -> None:
    posture = before_the_torso()
    image, silhouette = drawn(posture, gain)
    seen = grey(image) if is_grey else image
    term = InnerCue().build(measured(is_grey), CAMERA)
    for _ in range(20):
        observation = term.observe(frame(seen, silhouette, posture))
    wrong = posture.copy()
    wrong[6] = np.radians(-20)
    costs = beside(observation, posture[:4], "left", np.stack([posture, wrong])[:, 4:8])
    assert costs[0] < costs[1] - 50
    assert costs[0] < 0
    both = whole(observation, np.stack([posture, wrong]))
    assert both[0] < both[1] - 50


def flat_observation(hand: float, forearm: float) -> InnerCueObservation:
    """One that sees the same ratios everywhere."""
    term = InnerCue().build(measured(), CAMERA)
    assert isinstance(term, InnerCueTerm)
    maps = np.empty((2, 2000, 320), np.float32)  # beyond the image, so that no hand leaves it
    maps[0], maps[1] = hand, forearm
    gains = ArmGains(maps, (0, 0), np.array([0.7, 0.7]), 330.0 / 2.0, forearm_of(BODY))
    return InnerCueObservation(gains)


def test_a_gain_is_the_ratio_times_the_area_at_the_persons_place() -> None:
    arm = np.zeros((1, 4))  # it hangs, so the forearm shows its whole length
    px_per_m = 330.0 / 2.0
    hand_px = 0.09 * 0.075 * px_per_m**2
    forearm_px = 0.7 * BODY.size("forearm_width") * 0.72 * BODY.size("forearm_length") * px_per_m**2
    cost = beside(flat_observation(2.0, 0.0), np.zeros(4), "left", arm)
    assert cost[0] == pytest.approx(-0.7 * 2.0 * hand_px)
    cost = beside(flat_observation(0.0, -1.5), np.zeros(4), "right", arm)
    assert cost[0] == pytest.approx(0.7 * 1.5 * forearm_px)
    both = whole(flat_observation(2.0, -1.5), np.zeros((1, 12)))
    assert both[0] == pytest.approx(2 * 0.7 * (1.5 * forearm_px - 2.0 * hand_px))


def test_who_comes_nearer_gains_nothing_by_it() -> None:
    observation = flat_observation(2.0, 1.0)
    postures = np.zeros((3, 14))
    postures[:, 12] = (-0.5, 0.0, 0.5)
    np.testing.assert_allclose(whole(observation, postures), whole(observation, postures)[0])
    torsos = [np.array([0, 0, 0, 0, x, 0.1]) for x in (0.0, 0.5)]
    near, far = (beside(observation, torso, "left", np.zeros((1, 4))) for torso in torsos)
    assert near == pytest.approx(far)


def test_a_forearm_towards_the_camera_shows_less() -> None:
    observation = flat_observation(0.0, 1.0)
    arms = np.radians([[0.0, 0, 0, 0], [0, 0, 0, 85]])
    hanging, forwards = beside(observation, np.zeros(4), "left", arms)
    assert hanging < 2.5 * forwards < 0


def test_a_hand_behind_the_torso_shows_nothing() -> None:
    arms = np.radians([[0.0, -40, -50, 0], [30.0, -40, 0, 0]])
    behind, aside = beside(flat_observation(2.0, 2.0), np.zeros(4), "left", arms)
    assert behind == 0.0
    assert aside < 0.0


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.3, -0.1)])
def test_arms_are_projected_as_the_kinematics_place_them(offset: tuple[float, float]) -> None:
    camera = CAMERA.with_pitch(0.2)
    rng = np.random.default_rng(1)
    postures = np.hstack([rng.uniform(-0.6, 0.6, (20, 12)), np.tile(offset, (20, 1))])
    moved = BODY.with_values(
        distance_m=2.0 - offset[0], hip_height_m=BODY.placement.hip_height_m + offset[1]
    )
    optical = camera.reference_to_optical(pose(moved, postures[:, :12]).keypoints_m)
    posed = Posed(body_tuple(BODY, camera), postures)
    for arm, first in ((0, 1), (1, 4)):
        points, _ = arms_in_image(posed, arm)
        expected = camera.project(optical[:, first : first + 2])
        np.testing.assert_allclose(points[..., :2], expected, atol=1e-9)
        np.testing.assert_allclose(points[..., 2], 330.0 / optical[:, first : first + 2, 2])


def test_zones_are_where_head_and_torso_are() -> None:
    posture = np.zeros(14)
    posture[[0, 12, 13]] = 0.2, 0.4, 0.1
    moved = BODY.with_values(distance_m=1.6, hip_height_m=BODY.placement.hip_height_m + 0.1)
    frames = pose(moved, posture[:12])
    u, v, half_width, half_height, hips, top = zones_of(Posed(POSABLE, posture[None]))

    def pixel(point_m: Any) -> Any:
        return CAMERA.project(CAMERA.reference_to_optical(np.asarray(point_m)))

    head_m = 1.6 - BODY.size("head_offset")
    assert (u, v) == pytest.approx(tuple(pixel(frames.head)))
    assert half_width == pytest.approx(0.6 * BODY.size("head_width") * 330 / head_m)
    assert half_height == pytest.approx(0.6 * BODY.size("head_height") * 330 / head_m)
    waist_m = frames.hip + np.array([0, 0, 0.6 * BODY.size("waist_height")])
    assert hips == pytest.approx(pixel(waist_m)[1])
    assert top == pytest.approx(pixel(frames.neck)[1] + 0.02 * 330 / head_m)


def test_ratios_are_logarithms_by_zone_cut_off_and_silent_for_what_looks_alike() -> None:
    histograms = np.full((len(PARTS), 32), UNSEEN / 32)
    for part, color, share in ((0, 1, 0.9), (1, 1, 0.5), (1, 2, 0.4), (2, 2, 0.9), (3, 1, 0.9)):
        histograms[part, color] += share
    histograms[4, 3] += 0.9
    ratios = ratios_of(histograms)
    assert ratios.shape == (3, 2, 32)
    torso, head, below = 0, 1, 2
    hand, forearm = 0, 1
    assert ratios[torso, hand, 1] == 2.5  # log(0.903 / 0.003) is cut
    assert ratios[torso, hand, 2] == -2.5
    assert ratios[torso, hand, 5] == 0.0  # never seen in either
    assert ratios[torso, forearm, 2] == pytest.approx(np.log(0.403125 / 0.903125))
    assert not ratios[head, hand].any()  # the same histogram
    assert ratios[head, forearm, 1] == pytest.approx(np.log(0.503125 / 0.903125))
    # Below it is half torso, half legs.
    assert ratios[below, forearm, 2] == pytest.approx(np.log(0.403125 / 0.453125))


@pytest.mark.parametrize(
    ("image", "posture"),
    [
        (None, FRONT),
        (np.zeros((240, 320), np.uint8), FRONT),
        (np.zeros((240, 320, 3), np.uint8), None),
    ],
)
def test_without_a_comparable_image_or_a_posture_it_says_nothing(image: Any, posture: Any) -> None:
    term = InnerCue().build(measured(), CAMERA)
    silhouette = drawn(FRONT)[1]
    assert term.observe(frame(image, silhouette, posture)) is None


def test_a_person_whose_colours_are_unknown_is_tracked_without() -> None:
    assert InnerCue().build(BODY, CAMERA) is None
    with pytest.raises(ValueError, match="no appearance"):
        InnerCueTerm(InnerCue(), BODY, CAMERA)


def test_torsos_are_left_to_the_outline() -> None:
    image, silhouette = drawn(FRONT)
    observation = InnerCue().build(measured(), CAMERA).observe(frame(image, silhouette))
    assert observation.rate(Posed(POSABLE, np.zeros((4, 14)), TRUNK)).tolist() == [0, 0, 0, 0]


def test_parts_that_look_alike_say_nothing() -> None:
    torso = measured().appearance.levels[TORSO]
    same = Appearance(np.tile(torso, (5, 1)), np.full(3, 100.0))
    image, silhouette = drawn(FRONT)
    term = InnerCue().build(BODY.with_values(appearance=same), CAMERA)
    observation = term.observe(frame(image, silhouette))
    assert not whole(observation, np.stack([FRONT, before_the_torso()])).any()


def test_the_light_is_followed_and_forgotten_at_a_new_start() -> None:
    term = InnerCue(light=0.5).build(measured(), CAMERA)
    assert isinstance(term, InnerCueTerm)
    learned = term._brightness.copy()
    np.testing.assert_allclose(learned, SHIRT, atol=1)
    image, silhouette = drawn(FRONT, 0.8)
    term.observe(frame(image, silhouette))
    np.testing.assert_allclose(term._brightness, 0.9 * learned, atol=1)
    term.observe(frame(image, silhouette, None))
    np.testing.assert_array_equal(term._brightness, learned)
    # Nobody's light falls to a tenth; half of the way to the darkest that is believed.
    image, silhouette = drawn(FRONT, 0.1)
    term.observe(frame(image, silhouette))
    np.testing.assert_allclose(term._brightness, 0.8 * learned, atol=1)


def test_colours_learned_in_grey_serve_for_images_in_colour() -> None:
    posture = before_the_torso()
    image, silhouette = drawn(posture)
    body = measured(is_grey=True)
    costs = [
        whole(InnerCue().build(body, CAMERA).observe(frame(seen, silhouette)), posture[None])
        for seen in (image, grey(image))
    ]
    assert costs[0] == costs[1] != 0


def test_an_image_out_of_a_message_is_read_only_and_not_contiguous() -> None:
    image, silhouette = drawn(FRONT)
    term = InnerCue().build(measured(), CAMERA)
    expected = whole(term.observe(frame(image, silhouette)), FRONT[None])
    wide = np.zeros((240, 330, 3), np.uint8)
    wide[:, :320] = image
    wide.setflags(write=False)
    silhouette.setflags(write=False)
    again = InnerCue().build(measured(), CAMERA)
    assert whole(again.observe(frame(wide[:, :320], silhouette)), FRONT[None]) == expected


def test_an_empty_silhouette_is_nobody() -> None:
    term = InnerCue().build(measured(), CAMERA)
    nobody = np.zeros((240, 320), np.uint8)
    observation = term.observe(frame(np.zeros((240, 320, 3), np.uint8), nobody))
    assert not whole(observation, FRONT[None]).any()


def test_a_tracker_follows_a_hand_before_the_torso_with_the_image_only() -> None:
    """The hand moves up from belly to chest; the outline stays as it is."""
    body, low, high = measured(), FRONT.copy(), FRONT.copy()
    low[4:8] = np.radians((-10, 30, -40, 40))
    high[4:8] = np.radians((-10, 30, -110, 40))
    way = [(FRONT, low, share) for share in np.linspace(0.0, 1.0, 15)]
    way += [(low, high, share) for share in np.linspace(0.0, 1.0, 15)] + [(low, high, 1.0)] * 5
    truth = CAMERA.project(CAMERA.reference_to_optical(pose(body, high).keypoints_m))
    away_px = {}
    for with_image in (True, False):
        tracker = Tracker(body, CAMERA, default_preset(), np.random.default_rng(0))
        for begin, end, share in way:
            image, silhouette = drawn((1 - share) * begin + share * end)
            estimate = tracker.track(silhouette, image if with_image else None)
        assert estimate.keypoints_m is not None
        hand = CAMERA.project(estimate.keypoints_m)[2]
        away_px[with_image] = float(np.linalg.norm(hand - truth[2]))
    assert away_px[True] < 10 < 20 < away_px[False], away_px


@pytest.mark.parametrize("name", ["hand", "forearm", "light"])
def test_settings_have_ranges(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        InnerCue(**{name: -1.0})


def test_bins_of_the_two_kinds() -> None:
    assert (bins_of(1), bins_of(3)) == (32, 1728)
