"""Hands: open or closed by each finger, the palm and the wrist's angles, one look an image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.hand_network import HandPoints
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.pose_network import Square
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.hands import HandReader, directions, measured, opened

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of()
PICTURE = np.zeros((480, 640, 3), np.uint8)
SIDES = "left", "right"
RIGHT, DOWN, AHEAD = np.eye(3)
# Palm of the arm of :func:`arm`, whose wrist is 25 cm from the elbow.
PALM_M = 0.25 * 0.25 / 0.75
# Of each finger: how far its base is aside of the wrist, towards the little finger, and ahead.
BASES = (-0.03, 0.03), (-0.025, 0.09), (0.0, 0.09), (0.02, 0.085), (0.04, 0.08)


def hand(
    bent: tuple[float, ...] = (0.0,) * 5,
    fingers: FloatArray = -DOWN,
    palm: FloatArray = -AHEAD,
    side: str = "left",
    size_px: float | None = None,
) -> HandPoints:
    """A hand at the middle of the image whose fingers are bent to the palm by angles, rad.

    Without the longer side of its box, px, it has the size of the hand of :func:`arm`.
    """
    sign = 1.0 if side == "left" else -1.0
    little = sign * np.cross(fingers, palm)
    points = [np.zeros(3)]
    for number, ((aside, ahead), angle) in enumerate(zip(BASES, bent, strict=True)):
        base = aside * little + ahead * fingers
        # A thumb folds across the palm, and lies a little before it if it is open.
        base = base if number else base + 0.01 * palm
        straight = base / np.linalg.norm(base)
        across = palm if number else little
        joints = np.array([0.0, 0.4, 0.7, 1.0]) * (0.07 if number else 0.08)
        turned = np.cos(angle) * straight + np.sin(angle) * across
        first = base + joints[1] * (straight if number else turned)
        points += [base, first, *(first + (one - joints[1]) * turned for one in joints[2:])]
    spatial = np.array(points)
    flat = spatial[:, :2]
    px_per_m = CAMERA.fx / 2.0 * PALM_M / 0.09
    if size_px is not None:
        px_per_m = size_px / float(np.ptp(flat, axis=0).max())
    return HandPoints(np.array([159.5, 119.5]) + px_per_m * (flat - flat[0]), spatial)


FIST = (1.2, 2.6, 2.6, 2.6, 2.6)


def test_all_fingers_straight_are_an_open_hand_and_all_bent_a_closed_one() -> None:
    assert (opened(hand()) or 0.0) > 0.9
    assert (opened(hand(FIST)) or 1.0) < 0.1


@pytest.mark.parametrize("straight", [(1,), (1, 2), (2, 3, 4), (1, 2, 3, 4), (0,)])
def test_some_fingers_make_a_hand_neither_open_nor_closed(straight: tuple[int, ...]) -> None:
    bent = tuple(0.0 if finger in straight else angle for finger, angle in enumerate(FIST))
    value = opened(hand(bent))
    assert value is not None and 0.25 < value < 0.75


def test_a_hand_that_is_too_small_is_unknown() -> None:
    assert opened(hand(size_px=20.0)) is not None
    assert opened(hand(size_px=12.0)) is None
    assert opened(hand(FIST, size_px=10.0)) is None


def arm(side: str, forearm: FloatArray) -> tuple[Estimate, ImagePoints]:
    """An arm 2 m away whose upper arm hangs and whose wrist is at the middle of the image."""
    wrist = np.array([0.0, 0.0, 2.0])
    elbow = wrist - 0.25 * forearm
    joints = [elbow - 0.3 * DOWN, elbow, elbow + 0.25 * forearm / 0.75]
    first = SIDES.index(side) * 3
    keypoints = np.tile([0.3, 0.3, 2.0], (6, 1))
    keypoints[first : first + 3] = joints
    states = (KeypointState.TRACKED,) * 6
    found = Estimate("tracking", np.zeros(12), np.zeros(12), keypoints, keypoint_states=states)
    places = {"elbow": elbow, "wrist": wrist, "index": joints[2], "little_finger": joints[2]}
    named = {f"{side}_{name}": (*CAMERA.project(at), 1.0) for name, at in places.items()}
    return found, ImagePoints.of(named)


def angles(side: str, found: HandPoints, forearm: FloatArray) -> FloatArray:
    estimate, points = arm(side, forearm)
    return measured(side, found, points, estimate, CAMERA).wrist


@pytest.mark.parametrize("side", SIDES)
def test_the_wrist_is_straight_and_the_thumb_up(side: str) -> None:
    """The forearm points to the camera, so the palm faces the body's middle."""
    inwards = RIGHT if side == "right" else -RIGHT
    found = hand(fingers=-AHEAD, palm=inwards, side=side)
    np.testing.assert_allclose(angles(side, found, -AHEAD), 0.0, atol=0.1)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(
    ("flexion", "deviation", "least"),
    [(0.6, 0.0, 0.5), (-0.5, 0.0, 0.5), (0.0, 0.4, 0.4), (0.5, -0.3, 0.2)],
)
def test_flexion_is_to_the_palm_and_deviation_to_the_little_finger(
    side: str, flexion: float, deviation: float, least: float
) -> None:
    """The angles are between those of a straight wrist and the true ones, as wrists bend little."""
    inwards = RIGHT if side == "right" else -RIGHT
    straight = np.cos(flexion) * -AHEAD + np.sin(flexion) * inwards
    palm = np.cos(flexion) * inwards - np.sin(flexion) * -AHEAD
    # The thumb is up, and the little finger down.
    fingers = np.cos(deviation) * straight + np.sin(deviation) * DOWN
    found = angles(side, hand(fingers=fingers, palm=palm, side=side), -AHEAD)
    for value, true in zip(found, (flexion, deviation), strict=False):
        if true:
            assert least <= value / true < 1.1
        else:
            assert abs(value) < 0.1


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("palm", "rotation"), [(DOWN, np.pi / 2), (-DOWN, -np.pi / 2)])
def test_a_palm_that_faces_down_is_pronated(side: str, palm: FloatArray, rotation: float) -> None:
    found = angles(side, hand(fingers=-AHEAD, palm=palm, side=side), -AHEAD)
    np.testing.assert_allclose(found, [0.0, 0.0, rotation], atol=0.1)


def test_a_straight_arm_has_no_rotation() -> None:
    estimate, points = arm("left", DOWN)
    found = measured("left", hand(fingers=DOWN, palm=-RIGHT), points, estimate, CAMERA)
    assert np.isnan([found.wrist[2], found.wrist_stddev[2]]).all()
    np.testing.assert_allclose(found.wrist[:2], 0.0, atol=0.1)


@pytest.mark.parametrize("dives_rad", [-0.9, 0.9])
def test_fingers_that_only_the_networks_depth_bends_stay_straight(dives_rad: float) -> None:
    """In the image, the hand is as long as a hand that lies in its plane."""
    estimate, points = arm("left", DOWN)
    seen = hand(fingers=DOWN, palm=-AHEAD)
    dives = hand(
        fingers=np.cos(dives_rad) * DOWN + np.sin(dives_rad) * AHEAD,
        palm=-np.cos(dives_rad) * AHEAD + np.sin(dives_rad) * DOWN,
    )
    wrong = seen._replace(spatial_m=dives.spatial_m)
    found = measured("left", wrong, points, estimate, CAMERA)
    np.testing.assert_allclose(found.wrist[:2], 0.0, atol=0.1)
    np.testing.assert_allclose(found.palm, -AHEAD, atol=0.15)


def test_the_palm_is_that_of_the_ray_to_the_hand() -> None:
    """At the border of the image, a palm that faces the camera along the ray is turned with it."""
    estimate, points = arm("left", -DOWN)
    found = hand()
    aside = found._replace(px=found.px + np.array([150.0, 0.0]))
    palm = measured("left", aside, points, estimate, CAMERA).palm
    np.testing.assert_allclose(palm, -np.array([150.0, 0.0, 300.0]) / np.hypot(150, 300), atol=0.05)


@pytest.mark.parametrize("side", SIDES)
def test_the_depth_of_the_mirror_image_is_told_by_the_fingers(side: str) -> None:
    aside = RIGHT if side == "right" else -RIGHT
    palm = (aside - 0.5 * AHEAD) / np.sqrt(1.25)
    found = hand((0.5,) * 5, fingers=-DOWN, palm=palm, side=side)
    mirrored = found._replace(spatial_m=found.spatial_m * (1.0, 1.0, -1.0))
    estimate, points = arm(side, -DOWN)
    first, second = (measured(side, one, points, estimate, CAMERA) for one in (found, mirrored))
    np.testing.assert_allclose(first.palm, second.palm, atol=1e-9)
    assert first.palm @ palm > np.cos(0.3)


@pytest.mark.parametrize(("bent", "least", "most"), [(0.1, 44.0, 58.0), (0.5, 35.0, 45.0)])
def test_fingers_that_bend_more_make_the_mirror_image_less_likely(
    bent: float, least: float, most: float
) -> None:
    estimate, points = arm("left", -DOWN)
    palm = (-RIGHT - 0.5 * AHEAD) / np.sqrt(1.25)
    found = measured("left", hand((bent,) * 5, palm=palm), points, estimate, CAMERA)
    assert least < np.degrees(found.turn_stddev) < most


def test_the_flexion_of_a_hand_that_looks_too_short_is_less_sure() -> None:
    """Half as long and wide as usual: fingers may point to the camera, or it is a small hand."""
    estimate, points = arm("left", DOWN)
    whole = hand(fingers=DOWN)
    half = whole._replace(px=(whole.px + whole.px[0]) / 2)
    sure, unsure = (measured("left", one, points, estimate, CAMERA) for one in (whole, half))
    assert 1.3 < unsure.wrist_stddev[0] / sure.wrist_stddev[0] < 1.9


@given(turn=st.floats(-3.1, 3.1), flexion=st.floats(-1.4, 1.4), deviation=st.floats(-1.0, 1.0))
def test_directions_of_a_hand_are_a_frame_with_these_angles(
    turn: float, flexion: float, deviation: float
) -> None:
    found = directions(turn, flexion, deviation)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    palm, fingers, aside = found
    assert np.arcsin(-palm[2]) == pytest.approx(flexion)
    # The forearm in the plane of the palm, from which the hand deviates.
    straight = np.array([0.0, 0.0, 1.0]) - palm[2] * palm
    across = np.cos(deviation) * aside + np.sin(deviation) * fingers
    assert np.arctan2(fingers @ across, fingers @ straight / np.linalg.norm(straight)) == (
        pytest.approx(deviation)
    )
    np.testing.assert_allclose(directions(turn, 0.0, 0.0)[0], [np.cos(turn), np.sin(turn), 0.0])


class Looks:
    """Counts the looks and finds an open hand, or none."""

    def __init__(self) -> None:
        self.squares: list[Square] = []
        self.sees = True

    def __call__(self, image: object, square: Square) -> HandPoints | None:
        self.squares.append(square)
        return hand() if self.sees else None


def both() -> tuple[Estimate, ImagePoints]:
    estimate, left = arm("left", -AHEAD)
    other, right = arm("right", -AHEAD)
    assert estimate.keypoints_m is not None and other.keypoints_m is not None
    keypoints_m = np.concatenate([estimate.keypoints_m[:3], other.keypoints_m[3:]])
    estimate = replace(estimate, keypoints_m=keypoints_m)
    px = np.where(np.isnan(left.px), right.px + np.array([60.0, 0.0]), left.px)
    return estimate, ImagePoints(px, np.maximum(left.scores, right.scores))


def test_one_hand_an_image_is_looked_at_and_kept_until_its_turn() -> None:
    looks, (estimate, points) = Looks(), both()
    reader = HandReader(looks)
    seen = [
        reader.see(lambda: PICTURE, points, estimate, BODY, CAMERA, number / 10).hands
        for number in range(4)
    ]
    assert len(looks.squares) == 4
    columns = [square.u for square in looks.squares]
    assert columns[0] == columns[2] != columns[1] == columns[3]
    # The picture has twice the size of the camera's image.
    assert columns[1] - columns[0] == pytest.approx(120.0)
    assert [[one is not None for one in hands or ()] for hands in seen] == [
        [True, False],
        *[[True, True]] * 3,
    ]


def test_only_tracked_hands_are_looked_at() -> None:
    looks, (estimate, points) = Looks(), both()
    states = [KeypointState.TRACKED] * 6
    states[5] = KeypointState.HIDDEN
    reader, unsure = HandReader(looks), replace(estimate, keypoint_states=tuple(states))
    for number in range(3):
        found = reader.see(lambda: PICTURE, points, unsure, BODY, CAMERA, number / 10)
        assert found.hands is not None and found.hands[0] is not None and found.hands[1] is None
    assert len({square.u for square in looks.squares}) == 1
    assert reader.see(lambda: PICTURE, None, estimate, BODY, CAMERA, 2.0).hands == (None, None)


def test_a_hand_that_is_not_found_keeps_its_state_for_half_a_second() -> None:
    looks, (estimate, points) = Looks(), both()
    reader = HandReader(looks)
    known = []
    for number in range(9):
        looks.sees = number < 2
        found = reader.see(lambda: PICTURE, points, estimate, BODY, CAMERA, number / 10)
        known.append([one is not None for one in found.hands or ()])
    assert known[5:8] == [[True, True], [False, True], [False, False]]
    # Time that goes back, as in a loop, is no reason to keep it.
    assert reader.see(lambda: PICTURE, points, estimate, BODY, CAMERA, -1.0).hands == (None, None)


def test_points_that_are_not_known_place_no_square() -> None:
    looks, (estimate, _) = Looks(), both()
    empty = ImagePoints.of({})
    found = HandReader(looks).see(lambda: PICTURE, empty, estimate, BODY, CAMERA, 0.0)
    assert found.hands == (None, None) and not looks.squares


@pytest.mark.parametrize("side", SIDES)
def test_the_turn_is_that_of_the_hand_against_the_forearm(side: str) -> None:
    """The arm of the posture hangs; the network sees a palm that faces the camera, fingers down."""
    estimate, points = arm(side, DOWN)
    reader = HandReader(lambda *_: hand(fingers=DOWN, side=side))
    found = reader.see(lambda: PICTURE[::2, ::2], points, estimate, BODY, CAMERA, 0.0).hands
    assert found is not None
    seen = found[SIDES.index(side)]
    assert seen is not None
    # The palm of a person who faces the camera faces forwards, so the thumb has turned outwards.
    np.testing.assert_allclose(seen.joints, [-np.pi / 2, 0.0, 0.0], atol=0.1)
    assert (seen.joints_stddev > np.radians(10.0)).all()
    assert (seen.joints_stddev < np.radians([60.0, 25.0, 20.0])).all()
