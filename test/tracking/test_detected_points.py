"""Tracking with a detector's points: late, seldom, missing, exchanged, or of somebody else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import YAW, reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.terms.inner_cue import InnerCue
from cardbox_tracker.terms.joint_points import EVIDENCE
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker

Detect = Callable[..., ImagePoints]

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
MEASURED = BodyModel.of(hip_height_m=-0.51)
GUESSED = MEASURED.with_values(source="proportions")
BODIES = {"measured": MEASURED, "guessed": GUESSED}
BEGIN_NS = 10**18
HAND = 2


def hidden(time_s: float) -> np.ndarray:
    """The left hand moves before the torso, after a third of a second."""
    posture = reference_posture("front")
    if time_s > 0.3:
        swing = 30.0 * np.sin(np.pi * (time_s - 0.3))
        posture[4:8] = np.radians((10.0, 30.0, -70.0 - swing, 40.0))
    return posture


def test_the_search_expects_the_lean_of_the_legs_found_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tracker, expected = Tracker(MEASURED, CAMERA, default_preset()), []
    expect = tracker.filter._cost.expect

    def noted(*given: Any) -> None:
        expected.append(given[4])
        expect(*given)

    monkeypatch.setattr(tracker.filter._cost, "expect", noted)
    for lean_rad in (0.0, 0.3):
        tracker._legs.lean_rad = lean_rad
        tracker.track(silhouette(reference_posture("front")))
    assert expected[0] == 0.0 and expected[-1] == 0.3


def silhouette(posture: np.ndarray, body: BodyModel = MEASURED) -> np.ndarray:
    return render(cardbox_patches(body, posture), CAMERA)


def true_px(posture: np.ndarray) -> np.ndarray:
    """Shoulder, elbow, and hand of both arms, (6, 2)."""
    cost = WholeBodyCost(MEASURED, CAMERA, WholeBodyCostConfig())
    return CAMERA.project(cost.keypoints(np.append(posture, [0.0, 0.0])))


def exchanged(points: ImagePoints) -> ImagePoints:
    sides = {"left": "right", "right": "left"}
    first = [name.partition("_") for name in POINT_NAMES]
    order = [POINT_INDEX[sides.get(side, side) + dash + rest] for side, dash, rest in first]
    return replace(points, px=points.px[order], scores=points.scores[order])


def moved(points: ImagePoints, across_px: float) -> ImagePoints:
    return replace(points, px=points.px + np.array([across_px, 0.0]))


class Scene:
    """The hidden hand, its silhouettes, and what a detector without errors finds."""

    def __init__(self, detected: Detect, body: BodyModel = MEASURED) -> None:
        self.body, self.fps, self._detected = body, 15.0, detected

    def stamp_ns(self, number: int) -> int:
        return BEGIN_NS + round(number * 1e9 / self.fps)

    def posture(self, number: int) -> np.ndarray:
        return hidden(number / self.fps)

    def points(self, number: int) -> ImagePoints:
        posture = self.posture(number)
        return self._detected(self.body, CAMERA, posture, stamp_ns=self.stamp_ns(number))

    def track(
        self,
        given: Callable[[int], ImagePoints | None],
        seen: Callable[[int, np.ndarray], np.ndarray] = lambda number, person: person,
        count: int = 36,
        **config: Any,
    ) -> tuple[np.ndarray, list[Estimate]]:
        """Return errors (count, 6), px, and estimates; the points of a frame are ``given``."""
        tracker = Tracker(self.body, CAMERA, replace(default_preset(), **config))
        errors, estimates = np.full((count, 6), np.nan), []
        for number in range(count):
            posture = self.posture(number)
            person = seen(number, silhouette(posture))
            stamp_ns = self.stamp_ns(number)
            estimate = tracker.track(Observation(person, stamp_ns=stamp_ns, points=given(number)))
            estimates.append(estimate)
            if estimate.keypoints_m is not None:
                off = CAMERA.project(estimate.keypoints_m) - true_px(posture)
                errors[number] = np.linalg.norm(off, axis=1)
        return errors, estimates


def of_hand(found: tuple[np.ndarray, list[Estimate]], begin: int = 12) -> float:
    """Mean error of the hidden hand, px of 12 mm."""
    return float(found[0][begin:, HAND].mean())


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("yaw_deg", [-45.0, 30.0, 60.0])
def test_points_show_how_far_somebody_is_turned(
    detected: Detect, body: BodyModel, yaw_deg: float
) -> None:
    """The prior, which draws an outline to the front, does not draw points there."""
    tracker, posture = Tracker(body, CAMERA, default_preset()), reference_posture("front")
    for number in range(20):
        posture[YAW] = np.radians(yaw_deg) * min(number / 10, 1.0)
        points = detected(body, CAMERA, posture)
        estimate = tracker.track(Observation(silhouette(posture, body), points=points))
    assert estimate.posture is not None
    assert np.degrees(estimate.posture[YAW]) == pytest.approx(yaw_deg, abs=10.0)


def test_who_turns_once_round_is_followed(detected: Detect) -> None:
    tracker, posture = Tracker(MEASURED, CAMERA, default_preset()), reference_posture("front")
    for number in range(90):
        posture[YAW] = np.radians(5.0 * number)
        points = detected(MEASURED, CAMERA, posture)
        found = tracker.track(Observation(silhouette(posture, MEASURED), points=points)).posture
        assert found is not None and np.cos(found[YAW] - posture[YAW]) > np.cos(np.radians(25.0))


def is_tracked(found: tuple[np.ndarray, list[Estimate]], body: BodyModel) -> bool:
    """Whether all frames were, but for doubt about a hand's depth.

    The depth of a person who was not measured may be doubted altogether.
    """
    estimates = found[1]
    sure = [one.state == TRACKING or "hand may be elsewhere" in one.reason for one in estimates]
    least = 0.8 * len(sure) if body is MEASURED else 0
    return {one.state for one in estimates} <= {TRACKING, UNCERTAIN} and sum(sure) >= least


@pytest.fixture(params=BODIES.values(), ids=BODIES)
def scene(request: pytest.FixtureRequest, detected: Detect) -> Scene:
    return Scene(detected, request.param)


def test_a_hand_before_the_torso_is_found_with_points_only(scene: Scene) -> None:
    without, found = scene.track(lambda number: None), scene.track(scene.points)
    assert is_tracked(found, scene.body)
    assert of_hand(found) < 3.0
    assert of_hand(without) > 2.0 * of_hand(found)
    # The others are no worse than without.
    assert found[0][12:].mean(axis=0).max() < 3.0


def test_points_that_come_a_tenth_of_a_second_late_help(scene: Scene) -> None:
    """The hand moves by up to 7 px in this time."""
    scene.fps = 30.0
    late = scene.track(lambda number: scene.points(number - 3) if number >= 3 else None, count=60)
    without = scene.track(lambda number: None, count=60)
    assert of_hand(late, 20) < 6.0
    assert of_hand(late, 20) < 0.7 * of_hand(without, 20)


def test_points_at_5_hz_help_images_at_30_hz(scene: Scene) -> None:
    scene.fps = 30.0
    seldom = scene.track(lambda number: None if number % 6 else scene.points(number), count=60)
    assert of_hand(seldom, 20) < 4.0


def test_a_time_without_points_is_bridged_and_over_with_the_first_one(scene: Scene) -> None:
    gap = scene.track(lambda number: None if 15 <= number < 25 else scene.points(number))
    assert is_tracked(gap, scene.body)
    assert gap[0][15:17, HAND].max() < 6.0
    assert gap[0][27:, HAND].max() < 6.0


def test_left_and_right_may_be_exchanged_in_some_frames(scene: Scene) -> None:

    def given(number: int) -> ImagePoints:
        points = scene.points(number)
        is_wrong = number > 5 and (number % 3 == 0 or 20 <= number < 27)
        return exchanged(points) if is_wrong else points

    np.testing.assert_array_equal(scene.track(given)[0], scene.track(scene.points)[0])


@pytest.mark.parametrize("across_px", [-45.0, 60.0])
def test_points_of_somebody_else_for_some_frames_are_not_followed(
    scene: Scene, across_px: float
) -> None:
    """Half a metre and more beside the person."""

    def given(number: int) -> ImagePoints:
        points = scene.points(number)
        return moved(points, across_px) if 15 <= number < 20 else points

    found = scene.track(given)
    assert is_tracked(found, scene.body)
    others = [0, 1, 3, 4, 5]
    assert found[0][12:, others].max() < 8.0
    assert found[0][22:, HAND].max() < 6.0


def test_some_joints_may_be_unknown(scene: Scene) -> None:
    arm = [POINT_INDEX[f"left_{name}"] for name in ("elbow", "wrist", "index", "little_finger")]

    def given(number: int) -> ImagePoints:
        points = scene.points(number)
        scores = np.zeros(len(POINT_NAMES))
        scores[arm] = points.scores[arm]
        return replace(points, scores=scores)

    assert of_hand(scene.track(given)) < 3.5


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, -400.0, 999_999.0, 1e300])
def test_impossible_places_of_a_joint_change_little(scene: Scene, value: float) -> None:

    def given(number: int) -> ImagePoints:
        points = scene.points(number)
        px = points.px.copy()
        px[POINT_INDEX["right_wrist"]] = px[POINT_INDEX["right_elbow"]] = value
        return replace(points, px=px)

    found = scene.track(given, count=24)
    assert of_hand(found) < 3.5
    assert found[0][12:].max() < 12.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e5, 1e300])
def test_points_of_which_none_is_possible_are_as_none(scene: Scene, value: float) -> None:
    count = len(POINT_NAMES)
    wrong = ImagePoints(np.full((count, 2), value), np.ones(count))
    with_space = replace(wrong, spatial_m=np.full((count, 3), value))
    # From a first frame on, so that the person's place is known; 9 frames are no long time.
    given = lambda number: with_space if number else None  # noqa: E731
    found = scene.track(given, count=9)[0], scene.track(lambda number: None, count=9)[0]
    np.testing.assert_array_equal(*found)


def half(person: np.ndarray) -> np.ndarray:
    """A background that looks like the left half of the person."""
    cut = person.copy()
    cut[:, round(float(np.median(np.nonzero(person)[1]))) :] = 0
    return cut


def with_block(person: np.ndarray) -> np.ndarray:
    """A chair that was pushed, half a metre wide, touches the person."""
    more = person.copy()
    more[30:90, 100:150] = 255
    return more


def aside(person: np.ndarray) -> np.ndarray:
    """Light that changed: the silhouette is 0.3 m beside the person."""
    return np.roll(person, 25, axis=1)


@pytest.mark.parametrize("wrong", [half, with_block, aside])
def test_good_points_win_against_a_wrong_silhouette(
    scene: Scene, wrong: Callable[[np.ndarray], np.ndarray]
) -> None:

    def seen(number: int, person: np.ndarray) -> np.ndarray:
        return wrong(person) if number >= 15 else person

    usual = {"whole_body": default_preset().whole_body}
    found, estimates = scene.track(scene.points, seen, 30, **usual)
    assert {estimate.state for estimate in estimates} <= {TRACKING, UNCERTAIN}
    assert found[18:].mean(axis=0).max() < 4.5
    # Without points, a silhouette that does not fit means that the person is lost.
    without, _ = scene.track(lambda number: None, seen, 30, **usual, lost_frames=1000, lost_iou=0.0)
    assert np.nanmean(without[18:]) > 4.0 * found[18:].mean()


def beside() -> OtherCamera:
    """A camera 2 m from the person, 1.2 rad round to their left."""
    c, s = np.cos(1.2), np.sin(1.2)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    centre = np.array([0.0, 0.2, 2.0]) + 2.0 * turn.T @ [0.0, -0.1, -1.0]
    return OtherCamera(CAMERA, Extrinsics(turn, -turn @ centre))


@pytest.mark.parametrize("seeing", [(0,), (1,), (0, 1)])
@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_points_of_one_camera_of_two_are_enough(
    detected: Detect, body: BodyModel, seeing: tuple[int, ...]
) -> None:
    other = beside()
    view = View.of(body, CAMERA, other)
    tracker = Tracker(body, CAMERA, default_preset(), others=[other])
    cost = WholeBodyCost(body, CAMERA, WholeBodyCostConfig())
    errors_m = []
    for number in range(24):
        state = np.append(hidden(number / 15.0), [0.0, 0.0])
        there = view.states(state)
        placed = view.body.with_values(
            distance_m=view.body.placement.distance_m - there[12],
            hip_height_m=view.body.placement.hip_height_m + there[13],
        )
        persons = [
            silhouette(state[:12]),
            render(cardbox_patches(placed, there[:12]), view.camera),
        ]
        points = [detected(body, CAMERA, state), detected(view.body, view.camera, there)]
        stamp_ns = BEGIN_NS + number * 66_666_667
        estimate = tracker.track(
            [
                Observation(person, stamp_ns=stamp_ns, points=one if which in seeing else None)
                for which, (person, one) in enumerate(zip(persons, points, strict=True))
            ]
        )
        assert estimate.keypoints_m is not None
        errors_m.append(np.linalg.norm(estimate.keypoints_m - cost.keypoints(state), axis=1))
    assert np.mean(errors_m[12:], axis=0).max() < 0.06


def test_a_person_who_turns_round_is_followed_half_a_second_later(detected: Detect) -> None:
    """The silhouette shows no back; a detector that has exchanged the sides for long does."""
    scene = Scene(detected)

    def given(number: int) -> ImagePoints:
        points = scene.points(number)
        return exchanged(points) if 10 <= number < 30 else points

    errors, estimates = scene.track(given, count=50)
    yaws = [np.degrees(one.posture[YAW]) for one in estimates if one.posture is not None]
    assert np.abs(yaws[:17]).max() < 30.0
    assert np.abs(np.abs(yaws[20:36]) - 180.0).max() < 30.0
    assert np.abs(yaws[40:]).max() < 30.0
    # What was the left hand is the right one.
    hands = {number: estimates[number].keypoints_m for number in (9, 25)}
    assert hands[9] is not None and hands[25] is not None
    assert errors[9].max() < 6.0
    assert errors[25].max() > 20.0
    off = CAMERA.project(hands[25][[3, 4, 5, 0, 1, 2]]) - true_px(scene.posture(25))
    assert np.linalg.norm(off, axis=1).max() < 8.0
    for number in range(20, 36):
        assert estimates[number].state == UNCERTAIN
        states = estimates[number].keypoint_states
        assert states is not None and KeypointState.TRACKED not in states
    assert estimates[-1].state == TRACKING


@pytest.mark.parametrize("yaw_deg", [180.0, -150.0])
def test_a_person_who_is_first_seen_from_behind_is_tracked_so(
    detected: Detect, yaw_deg: float
) -> None:
    posture = reference_posture("front")
    posture[YAW], posture[4] = np.radians(yaw_deg), np.radians(70.0)
    tracker = Tracker(GUESSED, CAMERA, default_preset())
    for number in range(6):
        points = detected(GUESSED, CAMERA, posture, stamp_ns=BEGIN_NS + number * 66_666_667)
        estimate = tracker.track(
            Observation(silhouette(posture), stamp_ns=points.stamp_ns, points=points)
        )
    assert estimate.posture is not None and estimate.keypoints_m is not None
    off_rad = (estimate.posture[YAW] - posture[YAW] + np.pi) % (2 * np.pi) - np.pi
    assert abs(off_rad) < np.radians(25.0)
    px = CAMERA.project(estimate.keypoints_m) - true_px(posture)
    assert np.linalg.norm(px, axis=1).max() < 4.0
    assert estimate.state == UNCERTAIN


def test_points_leave_a_quarter_of_the_search(detected: Detect) -> None:
    counts = []
    scene = Scene(detected)
    for given in (None, scene.points(0)):
        tracker = Tracker(MEASURED, CAMERA, default_preset())
        for _ in range(4):
            found = tracker.track(Observation(silhouette(scene.posture(0)), points=given))
        assert isinstance(tracker.filter, WholeBodyFilter)
        counts.append(len(tracker.filter.rated.states))
        # What the points say joins what the silhouette says.
        assert found.evidence is not None
        assert set(EVIDENCE).issubset(found.evidence) == (given is not None)
        assert "residual" in found.evidence
    assert 0.2 < counts[1] / counts[0] < 0.45


def values(estimate: Estimate) -> list[bytes | None]:
    """The numbers of an estimate, byte for byte."""
    arrays = (
        *(estimate.posture, estimate.posture_stddev, estimate.keypoints_m),
        *(estimate.offset_m, estimate.offset_stddev_m),
    )
    return [None if one is None else one.tobytes() for one in arrays]


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_without_points_the_term_changes_no_byte(body: BodyModel) -> None:
    usual = default_preset()
    assert len(usual.terms) == 2
    trackers = [Tracker(body, CAMERA, one) for one in (usual, replace(usual, terms=(InnerCue(),)))]
    for number in range(8):
        person = silhouette(wave(number / 8.0))
        first, second = (tracker.track(Observation(person)) for tracker in trackers)
        assert (first.state, first.cost_px, first.iou) == (second.state, second.cost_px, second.iou)
        assert values(first) == values(second)
        assert first.posture is not None


def test_the_same_points_give_the_same_bytes(scene: Scene) -> None:
    first, second = (scene.track(scene.points, count=8)[1] for _ in range(2))
    assert [values(one) for one in first] == [values(one) for one in second]


def test_after_a_reset_the_points_before_are_forgotten(detected: Detect) -> None:
    scene, person = Scene(detected), silhouette(hidden(1.0))
    fresh, used = (Tracker(MEASURED, CAMERA, default_preset()) for _ in range(2))
    used.track(Observation(person, points=moved(scene.points(15), 10.0)))
    used.reset()
    after, never = used.track(Observation(person)), fresh.track(Observation(person))
    assert after.evidence is not None and never.evidence is not None
    assert after.posture is not None
    # Nothing of the points is left to fit or to doubt.
    assert set(after.evidence) == set(never.evidence)
    assert "point distance" not in after.evidence


@pytest.mark.parametrize(
    ("points", "kind"),
    [
        (np.zeros((17, 2)), "ndarray"),
        ([(1.0, 2.0)], "list"),
        ({"nose": (1.0, 2.0, 0.9)}, "dict"),
        ("nose", "str"),
        (0, "int"),
    ],
)
def test_points_of_another_type_are_refused(points: Any, kind: str) -> None:
    tracker, fresh = (Tracker(MEASURED, CAMERA, default_preset()) for _ in range(2))
    person = silhouette(hidden(0.0))
    with pytest.raises(ValueError, match=rf"type {kind}; expected ImagePoints"):
        tracker.track(Observation(person, points=points))
    # It changes nothing for the next frame.
    assert values(tracker.track(person)) == values(fresh.track(person))


def from_two_sides(
    detected: Detect, posture: np.ndarray, images: int, bearing_deg: float = 180.0
) -> list[Estimate]:
    """Track a still posture before two cameras whose lines of sight meet at 2 m.

    The second one has points, and the first one if it does not see the front.
    """
    turn = Rotation.from_euler("y", bearing_deg, degrees=True).as_matrix()
    middle_m = np.array([0.0, 0.0, 2.0])
    other = OtherCamera(CAMERA, Extrinsics(turn, middle_m - turn @ middle_m))
    view = View.of(GUESSED, CAMERA, other)
    tracker = Tracker(GUESSED, CAMERA, default_preset(), others=[other])
    there = view.states(np.append(posture, [0.0, 0.0]))
    placed = view.body.with_values(
        distance_m=view.body.placement.distance_m - there[12],
        hip_height_m=view.body.placement.hip_height_m + there[13],
    )
    beyond = render(cardbox_patches(placed, there[:12]), view.camera)
    estimates = []
    for number in range(images):
        stamp_ns = BEGIN_NS + number * 66_666_667
        here = None
        if posture[YAW] != 0.0:
            here = detected(GUESSED, CAMERA, posture, stamp_ns=stamp_ns)
        points = detected(view.body, view.camera, there, stamp_ns=stamp_ns)
        seen = [
            Observation(silhouette(posture), stamp_ns=stamp_ns, points=here),
            Observation(beyond, stamp_ns=stamp_ns, points=points),
        ]
        estimates.append(tracker.track(seen))
    return estimates


def test_a_camera_behind_a_person_who_faces_the_first_one_does_not_turn_them(
    detected: Detect,
) -> None:
    for estimate in from_two_sides(detected, reference_posture("front"), 4):
        assert estimate.posture is not None and abs(estimate.posture[YAW]) < np.radians(20.0)


@pytest.mark.parametrize("yaw_deg", [180.0, 60.0, -60.0])
def test_the_camera_that_the_person_faces_most_says_how_sure_the_posture_is(
    detected: Detect, yaw_deg: float
) -> None:
    posture = reference_posture("front")
    posture[YAW] = np.radians(yaw_deg)
    last = from_two_sides(detected, posture, 6, bearing_deg=yaw_deg)[-1]
    assert last.posture is not None and last.evidence is not None
    off_rad = (last.posture[YAW] - posture[YAW] + np.pi) % (2 * np.pi) - np.pi
    assert abs(off_rad) < np.radians(20.0)
    # Before that camera the person is not turned, and the arms lie across the line of sight.
    assert last.evidence["yaw"].max() < np.radians(20.0)
    assert last.evidence["slope"].max() < 0.5
    assert (last.state, last.reason) == (TRACKING, "")
