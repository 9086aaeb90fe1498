"""The cost of a detector's points: by hand, its limits, and the points that are not used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import exp, hypot

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints, LegPoints
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture, state_limits
from cardbox_tracker.terms import joint_points_kernels as kernels
from cardbox_tracker.terms.joint_points import (
    EVIDENCE,
    JointPoints,
    JointPointsObservation,
    JointPointsTerm,
)
from cardbox_tracker.terms.kernel_arguments import Drawn
from cardbox_tracker.terms.term import ARM, TRUNK, WHOLE, Frame, Posed
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

Detect = Callable[..., ImagePoints]

PITCH = 0.2
CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5, PITCH)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=PITCH)
STATE_LIMITS = state_limits(2.3)
GUESSED = BODY.with_values(source="proportions")
COST = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
FOREGROUND_PX = 1000
WEIGHT_PX = 0.012 * FOREGROUND_PX
SEC = 10**9
NOTHING = np.zeros((240, 320), np.uint8)

STATE = np.append(reference_posture("front"), [0.1, 0.02])
STATE[:4] = 0.1, 0.05, 0.2, 0.3
STATE[4:12] += 0.2, 0.4, -0.6, 0.7, 0.1, 0.2, 0.3, 0.9


def frame(
    points: ImagePoints | None, before: np.ndarray | None = None, stamp_ns: int | None = None
) -> Frame:
    channels = {"silhouette": NOTHING} | ({} if points is None else {"points": points})
    posed = None if before is None else Posed(COST.body, before[None])
    return Frame(CAMERA, channels, 240, FOREGROUND_PX, posed, stamp_ns=stamp_ns)


def rated(seen: JointPointsObservation, states: np.ndarray, parts: Drawn = WHOLE) -> np.ndarray:
    return seen.rate(Posed(COST.body, states, parts))


def observed(
    points: ImagePoints,
    before: np.ndarray | None = None,
    body: BodyModel = BODY,
    stamp_ns: int | None = None,
) -> JointPointsObservation:
    seen = JointPoints().build(body, CAMERA).observe(frame(points, before, stamp_ns))
    assert isinstance(seen, JointPointsObservation)
    return seen


def cost_of(points: ImagePoints, stamp_ns: int | None = None) -> float:
    """Of STATE, in units of the weight."""
    return float(rated(observed(points, stamp_ns=stamp_ns), STATE[None])[0]) / WEIGHT_PX


def moved(points: ImagePoints, name: str, across_px: float, down_px: float = 0.0) -> ImagePoints:
    px = points.px.copy()
    px[POINT_INDEX[name]] += across_px, down_px
    return replace(points, px=px)


def only(points: ImagePoints, *names: str) -> ImagePoints:
    kept = np.isin(POINT_NAMES, names)
    return replace(points, scores=np.where(kept, points.scores, 0.0))


def only_bone_of(seen: JointPointsObservation) -> JointPointsObservation:
    """The same without points: what is left is the line between the shoulders."""
    points, *others = seen.seen
    return replace(seen, seen=(0.0 * points, *others))


def exchanged(points: ImagePoints) -> ImagePoints:
    """A detector that takes the left side for the right one."""

    def other(name: str) -> str:
        first, _, rest = name.partition("_")
        return f"{'right' if first == 'left' else 'left'}_{rest}" if rest else name

    order = [POINT_INDEX[other(name)] for name in POINT_NAMES]
    return replace(points, px=points.px[order], scores=points.scores[order])


def test_joints_are_projected_where_the_model_has_them() -> None:
    pixels = np.empty((kernels.N_POINTS, 3))
    kernels.project(STATE, COST.body, pixels)
    keypoints_m = COST.keypoints(STATE)
    # The wrist is 0.146 of the stature from the elbow, and 0.054 from the knuckles.
    wrists_m = keypoints_m[[1, 4]] + 0.73 * (keypoints_m[[2, 5]] - keypoints_m[[1, 4]])
    place = BODY.placement
    there = BODY.with_values(
        distance_m=place.distance_m - STATE[12], hip_height_m=place.hip_height_m + STATE[13]
    )
    frames = pose(there.rigid, STATE[:12])
    for rows, points_m in (
        ([0, 1, 3, 4, 5, 7], keypoints_m),
        ([2, 6], wrists_m),
        ([8], CAMERA.reference_to_optical(np.atleast_2d(frames.hip))),
        ([9], CAMERA.reference_to_optical(np.atleast_2d(frames.head))),
    ):
        np.testing.assert_allclose(pixels[rows, :2], CAMERA.project(points_m), atol=1e-6)
        np.testing.assert_allclose(pixels[rows, 2], points_m[:, 2], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "keypoint", "deviation_m"),
    [("left_shoulder", 0, 0.025), ("left_elbow", 1, 0.02), ("right_elbow", 4, 0.02)],
)
def test_a_point_one_deviation_away_costs_about_one(
    detected: Detect, name: str, keypoint: int, deviation_m: float
) -> None:
    points = detected(BODY, CAMERA, STATE, 1.0)
    assert cost_of(points) == pytest.approx(0.0, abs=1e-12)
    deviation_px = hypot(deviation_m * 300.0 / COST.keypoints(STATE)[keypoint, 2], 1.5)
    expected = 16.0 * (1.0 - exp(-1.0 / 16.0))
    assert 0.95 < expected < 1.0
    assert cost_of(moved(points, name, deviation_px)) == pytest.approx(expected)
    aslant = deviation_px / np.sqrt(2.0)
    assert cost_of(moved(points, name, -aslant, aslant)) == pytest.approx(expected)
    twice = 16.0 * (1.0 - exp(-4.0 / 16.0))
    assert cost_of(moved(points, name, 2.0 * deviation_px)) == pytest.approx(twice)


def test_a_wrong_point_costs_no_more_than_the_limit_times_its_score(detected: Detect) -> None:
    points = moved(detected(BODY, CAMERA, STATE, 0.5), "left_wrist", 1e5)
    assert cost_of(points) == pytest.approx(0.5 * 16.0)


def test_hands_hips_and_ears_are_the_middle_of_two_points(detected: Detect) -> None:
    points = detected(BODY, CAMERA, STATE, 1.0)
    for one, other in (
        ("left_index", "left_little_finger"),
        ("left_hip", "right_hip"),
        ("left_ear", "right_ear"),
    ):
        apart = moved(moved(points, one, 9.0, -4.0), other, -9.0, 4.0)
        assert cost_of(apart) == pytest.approx(0.0, abs=1e-12)
        # With one of the two alone there is no middle.
        scores = points.scores.copy()
        scores[POINT_INDEX[other]] = 0.0
        assert cost_of(moved(replace(points, scores=scores), one, 50.0)) == pytest.approx(0.0)


def test_unknown_points_and_points_of_no_joint_cost_nothing(detected: Detect) -> None:
    points = detected(BODY, CAMERA, STATE, 0.9)
    wrong = moved(points, "left_wrist", 1e5)
    scores = wrong.scores.copy()
    scores[POINT_INDEX["left_wrist"]] = 0.0
    assert cost_of(replace(wrong, scores=scores)) == pytest.approx(0.0)
    nose = ImagePoints.of({"nose": (5.0, 5.0, 1.0)})
    assert cost_of(nose) == 0.0


@pytest.mark.parametrize("late_s", [0.0, 0.1, 0.4, -0.4])
def test_deviations_grow_with_the_age(detected: Detect, late_s: float) -> None:
    points = detected(BODY, CAMERA, STATE, 1.0, 5 * SEC)
    off_px, depth_m = 12.0, COST.keypoints(STATE)[1, 2]
    # The elbow of a person who moves may have gone on by half a metre a second.
    deviation_m = hypot(0.02, 0.5 * abs(late_s))
    square = off_px**2 / (1.5**2 + (deviation_m * 300.0 / depth_m) ** 2)
    stamp_ns = 5 * SEC + round(late_s * SEC)
    found = cost_of(moved(points, "left_elbow", off_px), stamp_ns)
    assert found == pytest.approx(16.0 * (1.0 - exp(-square / 16.0)))


def test_points_older_than_a_second_are_not_used(detected: Detect) -> None:
    term = JointPoints().build(BODY, CAMERA)
    points = detected(BODY, CAMERA, STATE, stamp_ns=5 * SEC)
    assert term.observe(frame(points, STATE, 7 * SEC)) is None


def given_in_space(bones_m: np.ndarray) -> np.ndarray:
    """Points in space (17, 3) of these shoulders, elbows and hands, (6, 3)."""
    spatial_m = np.zeros((len(POINT_NAMES), 3))
    for first, side in ((0, "left"), (3, "right")):
        spatial_m[POINT_INDEX[f"{side}_shoulder"]] = bones_m[first]
        spatial_m[POINT_INDEX[f"{side}_elbow"]] = bones_m[first + 1]
        spatial_m[[POINT_INDEX[f"{side}_{name}"] for name in ("index", "little_finger")]] = bones_m[
            first + 2
        ]
    return spatial_m


def level_sight_to(points: ImagePoints) -> np.ndarray:
    """The horizontal direction, away from the camera, to the middle of the shoulders."""
    shoulders = points.px[[POINT_INDEX["left_shoulder"], POINT_INDEX["right_shoulder"]]]
    bearing = np.arctan2(shoulders[:, 0].mean() - 159.5, 300.0)
    return CAMERA.reference_to_optical(np.array([-np.cos(bearing), np.sin(bearing), 0.0]))


def expected_of_bones(
    spatial_m: np.ndarray, points: ImagePoints, age_s: float = 0.0, first: int = 0
) -> float:
    """The cost of the five bones by hand, along the horizontal line of sight, from one on."""
    away = level_sight_to(points)
    joints_m, total = COST.keypoints(STATE), 0.0
    bones = (
        (0, 1, 0.22, 0.06),
        (1, 2, 0.32, -0.13),
        (3, 4, 0.22, 0.06),
        (4, 5, 0.32, -0.13),
        (3, 0, 0.2, 0.05),
    )
    for begin, end, deviation, offset in bones[first:]:
        bone_m, found_m = joints_m[end] - joints_m[begin], spatial_m[end] - spatial_m[begin]
        along = bone_m @ away / np.linalg.norm(bone_m)
        found = found_m[2] / np.linalg.norm(found_m) - offset
        if begin == 3 and end == 0:
            # The detector makes turns of the shoulders too small.
            found = 1.5 * found - 0.5 * found**3
        square = ((along - found) / (deviation * (1.0 + age_s / 0.1))) ** 2
        total += 16.0 * (1.0 - exp(-square / 16.0))
    return total


@pytest.mark.parametrize("age_s", [0.0, 0.1])
def test_bones_are_compared_along_the_horizontal_line_of_sight(
    detected: Detect, age_s: float
) -> None:
    joints_m = np.random.default_rng(0).normal(0.0, 0.3, (6, 3))
    points = detected(GUESSED, CAMERA, STATE, 1.0, 5 * SEC)
    points = replace(points, spatial_m=given_in_space(joints_m))
    stamp_ns = 5 * SEC + round(age_s * SEC)
    found = rated(observed(points, body=GUESSED, stamp_ns=stamp_ns), STATE[None])[0] / WEIGHT_PX
    assert found == pytest.approx(expected_of_bones(joints_m, points, age_s), rel=1e-6)
    assert found > 1.0
    # Of people who were measured, the outlines determine the depth of the arms.
    of_shoulders = rated(observed(points, stamp_ns=stamp_ns), STATE[None])[0] / WEIGHT_PX
    assert of_shoulders == pytest.approx(expected_of_bones(joints_m, points, age_s, 4), rel=1e-6)
    assert of_shoulders > 0.1


@pytest.mark.parametrize(("score", "counts"), [(0.9, True), (0.4, False)], ids=["legs", "none"])
def test_a_trunk_is_compared_along_the_horizontal_line_of_sight_if_legs_are_seen(
    detected: Detect, score: float, counts: bool
) -> None:
    """The trunk leans to the camera by 0.6 of its length, 0.45 without the detector's offset."""
    points = detected(BODY, CAMERA, STATE, 1.0)
    spatial_m = np.zeros((len(POINT_NAMES), 3))
    spatial_m[[POINT_INDEX[f"{side}_shoulder"] for side in ("left", "right")]] = 0.0, -0.8, -0.6
    spatial_m[POINT_INDEX["left_shoulder"], 0] += 0.2
    spatial_m[POINT_INDEX["right_shoulder"], 0] -= 0.2
    legs = LegPoints(np.zeros((8, 2)), np.full(8, score))
    alike = observed(replace(points, spatial_m=spatial_m))
    found = rated(observed(replace(points, spatial_m=spatial_m, legs=legs)), STATE[None])
    found -= rated(alike, STATE[None])
    joints_m = COST.keypoints(STATE)
    trunk_m = joints_m[[0, 3]].mean(axis=0) - np.array(COST.hips(STATE))
    along = trunk_m @ level_sight_to(points) / np.linalg.norm(trunk_m)
    square = ((along + 0.45) / 0.12) ** 2
    expected = 16.0 * (1.0 - exp(-square / 16.0)) if counts else 0.0
    assert found[0] / WEIGHT_PX == pytest.approx(expected, rel=1e-3)


def test_what_is_not_finite_in_space_costs_nothing(detected: Detect) -> None:
    points = detected(GUESSED, CAMERA, STATE, 1.0)
    for value in (np.nan, np.inf, -np.inf, 1e300):
        wrong = replace(points, spatial_m=np.full((len(POINT_NAMES), 3), value))
        seen = observed(wrong, body=GUESSED)
        assert rated(seen, STATE[None])[0] == pytest.approx(0.0, abs=1e-9)
    # All points at the same place have no direction.
    same = replace(points, spatial_m=np.zeros((len(POINT_NAMES), 3)))
    assert rated(observed(same, body=GUESSED), STATE[None])[0] == pytest.approx(0.0, abs=1e-9)


SHARES = arrays(np.float64, (3, 14), elements=st.floats(0.0, 1.0))
PIXELS = arrays(np.float64, (17, 2), elements=st.floats(-1e6, 1e6))


@settings(max_examples=60)
@given(
    shares=SHARES,
    px=PIXELS,
    scores=arrays(np.float64, 17, elements=st.floats(0.0, 1.0)),
    spatial_m=arrays(np.float64, (17, 3), elements=st.floats(width=64)),
    age_ns=st.integers(0, SEC),
)
def test_a_cost_is_between_0_and_the_limit(
    shares: np.ndarray, px: np.ndarray, scores: np.ndarray, spatial_m: np.ndarray, age_ns: int
) -> None:
    low, high = STATE_LIMITS.T
    states = low + shares * (high - low)
    points = ImagePoints(px, scores, 5 * SEC, spatial_m)
    if points.is_empty:
        return
    seen = observed(points, body=GUESSED, stamp_ns=5 * SEC + age_ns)
    found, _, bones, _ = seen.seen
    most = WEIGHT_PX * 16.0 * (found[:, 2].sum() + bones[:, 1].sum()) + 1e-9
    for parts in (WHOLE, TRUNK, *ARM):
        costs = rated(seen, states, parts)
        assert costs.shape == (3,)
        assert ((costs >= 0.0) & (costs <= most)).all()


@settings(max_examples=40)
@given(shares=SHARES, noise_px=arrays(np.float64, (17, 2), elements=st.floats(-30, 30)))
def test_trunk_and_arms_add_up_to_the_body(
    detected: Detect, shares: np.ndarray, noise_px: np.ndarray
) -> None:
    low, high = STATE_LIMITS.T
    states = low + shares * (high - low)
    points = detected(GUESSED, CAMERA, STATE)
    points = replace(points, px=points.px + noise_px)
    seen = observed(points, body=GUESSED)
    shoulders = observed(only(points, "left_shoulder", "right_shoulder"), body=GUESSED)
    total = sum(rated(seen, states, parts) for parts in (TRUNK, *ARM))
    # The shoulders count for the trunk and for their arms.
    total -= rated(shoulders, states, TRUNK)
    total += rated(only_bone_of(shoulders), states, TRUNK)
    np.testing.assert_allclose(total, rated(seen, states), rtol=1e-9, atol=1e-9)


@settings(max_examples=40)
@given(shares=SHARES, noise_px=arrays(np.float64, (17, 2), elements=st.floats(-30, 30)))
def test_twice_the_residuals_times_their_jacobian_is_the_gradient_of_the_cost(
    detected: Detect, shares: np.ndarray, noise_px: np.ndarray
) -> None:
    low, high = STATE_LIMITS.T
    states = low + shares * (high - low)
    # Nearer than this, the projection is cut off.
    states[:, 12] = np.minimum(states[:, 12], 0.8)
    points = detected(GUESSED, CAMERA, STATE)
    joints_m = np.random.default_rng(0).normal(0.0, 0.3, (6, 3))
    points = replace(points, px=points.px + noise_px, spatial_m=given_in_space(joints_m))
    seen = observed(points, body=GUESSED)

    def costs(at: np.ndarray) -> np.ndarray:
        return seen.residuals(Posed(COST.body, at)).costs

    found = seen.residuals(Posed(COST.body, states))
    gradient = 2.0 * np.einsum("nr,nrd->nd", found.values, found.jacobian)
    for number in range(14):
        step = np.eye(14)[number] * 1e-6
        slope = (costs(states + step) - costs(states - step)) / 2e-6
        np.testing.assert_allclose(gradient[:, number], slope, rtol=1e-3, atol=1e-2)


def test_without_points_nothing_is_rated() -> None:
    term = JointPoints().build(BODY, CAMERA)
    for points in (None, ImagePoints.of({})):
        assert term.observe(frame(points, STATE)) is None


def test_points_of_an_earlier_frame_count_less_and_less(detected: Detect) -> None:
    term = JointPoints().build(BODY, CAMERA)
    points = moved(detected(BODY, CAMERA, STATE), "left_wrist", 20.0)
    costs = []
    for given_points in (points, *[None] * 14):
        seen = term.observe(frame(given_points, STATE))
        assert isinstance(seen, JointPointsObservation)
        costs.append(float(rated(seen, STATE[None])[0]))
    assert (np.diff(costs) < 0.0).all()
    assert costs[-1] < 0.02 * costs[0]
    # An interval is 1/15 s; after a second they are forgotten.
    assert [term.observe(frame(None, STATE)) is None for _ in range(2)] == [
        False,
        True,
    ]


def test_at_a_new_start_the_points_before_are_forgotten(detected: Detect) -> None:
    term = JointPoints().build(BODY, CAMERA)
    term.observe(frame(detected(BODY, CAMERA, STATE), STATE))
    assert term.observe(frame(None)) is None


def test_left_and_right_are_exchanged_if_they_only_fit_so(detected: Detect) -> None:
    points = detected(BODY, CAMERA, STATE)
    wrong = exchanged(points)
    assert cost_of(wrong) > 50.0
    assert rated(observed(wrong, STATE), STATE[None])[0] == pytest.approx(0.0, abs=1e-9)
    # Without a posture before, nobody knows.
    assert rated(observed(wrong), STATE[None])[0] > 50.0 * WEIGHT_PX


def test_points_in_space_are_exchanged_with_the_others(detected: Detect) -> None:
    joints_m = np.random.default_rng(0).normal(0.0, 0.3, (6, 3))
    points = replace(detected(GUESSED, CAMERA, STATE, 1.0), spatial_m=given_in_space(joints_m))
    other_m = given_in_space(joints_m[[3, 4, 5, 0, 1, 2]])
    wrong = replace(exchanged(points), spatial_m=other_m)
    right, same = (rated(observed(one, STATE, GUESSED), STATE[None]) for one in (points, wrong))
    np.testing.assert_allclose(same, right)


def test_hands_that_move_far_are_not_exchanged(detected: Detect) -> None:
    """The right hand goes where nobody was: the left one is still nearer to its own place."""
    now = STATE.copy()
    now[8:12] = np.radians((120.0, 0.0, 0.0, 0.0))
    seen = observed(detected(BODY, CAMERA, now), STATE)
    assert rated(seen, now[None])[0] == pytest.approx(0.0, abs=1e-9)


def test_points_of_somebody_else_are_not_used_unless_this_lasts(detected: Detect) -> None:
    term = JointPoints().build(BODY, CAMERA)
    aside = detected(BODY, CAMERA, STATE)
    aside = replace(aside, px=aside.px + np.array([90.0, 0.0]))  # 0.7 m
    seen = [term.observe(frame(aside, STATE)) for _ in range(11)]
    assert [one is None for one in seen] == [True] * 10 + [False]


def test_one_frame_of_the_person_begins_the_count_anew(detected: Detect) -> None:
    term = JointPointsTerm(JointPoints(), BODY, CAMERA)
    own = detected(BODY, CAMERA, STATE)
    aside = replace(own, px=own.px + np.array([90.0, 0.0]))
    for points in (*[aside] * 9, own, *[aside] * 9):
        seen = term.observe(frame(points, STATE))
    # The person's own points, of nine frames ago.
    assert isinstance(seen, JointPointsObservation)
    np.testing.assert_array_equal(seen.seen[0][1, :2], own.px[POINT_INDEX["left_elbow"]])


def test_a_jump_of_one_joint_is_no_other_person(detected: Detect) -> None:
    points = moved(detected(BODY, CAMERA, STATE), "left_wrist", 200.0)
    assert rated(observed(points, STATE), STATE[None])[0] == pytest.approx(0.9 * 16.0 * WEIGHT_PX)


def test_points_that_stay_exchanged_show_the_persons_back(detected: Detect) -> None:
    """A detector errs for an image or two; after half a second it is right."""
    term = JointPointsTerm(JointPoints(), BODY, CAMERA)
    points = detected(BODY, CAMERA, STATE)
    back = exchanged(points)

    def shown(given: ImagePoints | None) -> bool:
        seen = term.observe(replace(frame(given, STATE), interval_s=0.1))
        assert isinstance(seen, JointPointsObservation)
        return seen.shows_back

    assert [shown(back) for _ in range(8)] == [False] * 5 + [True] * 3
    assert not shown(points)
    assert not shown(back)
    # A detector that is slower than the camera is right after the same time.
    assert [shown(one) for one in (None, None, back, None, back)] == [False] * 4 + [True]


def test_evidence_of_exact_points_by_hand(detected: Detect) -> None:
    seen = observed(detected(BODY, CAMERA, STATE))
    found = seen.evidence(Posed(COST.body, STATE[None]))
    assert set(found) == set(EVIDENCE)
    np.testing.assert_allclose(found["point distance"], 0.0, atol=1e-6)
    for name in ("point missing", "depth difference"):
        assert found[name].tolist() == [0.0] * 6
    joints_m = COST.keypoints(STATE)
    middle_m = np.linalg.norm((joints_m[0] + joints_m[3]) / 2)
    assert found["distance"].tolist() == pytest.approx([middle_m] * 6)
    # What a bone has along the optical axis, of its length; shoulders end no bone.
    for shoulder, elbow, hand in ((0, 1, 2), (3, 4, 5)):
        upper_arm, forearm = np.diff(joints_m[[shoulder, elbow, hand]], axis=0)
        shares = [abs(bone[2]) / np.linalg.norm(bone) for bone in (upper_arm, forearm)]
        assert found["foreshortened"][[elbow, hand]].tolist() == pytest.approx(shares)
        assert found["foreshortened"][shoulder] == 0.0
        assert found["elbow foreshortened"][hand] == pytest.approx(shares[0])
        assert found["elbow foreshortened"][elbow] == 0.0


def test_evidence_of_a_moved_point_and_of_a_missing_one(detected: Detect) -> None:
    points = moved(detected(BODY, CAMERA, STATE), "left_elbow", 12.0, 5.0)
    missing = POINT_INDEX["right_wrist"]
    scores = points.scores.copy()
    scores[missing] = 0.4
    found = observed(replace(points, scores=scores)).evidence(Posed(COST.body, STATE[None]))
    # 13 px at the depth of the elbow.
    depth_m = COST.keypoints(STATE)[1, 2]
    expected_m = np.eye(6)[1] * 13.0 * depth_m / CAMERA.fx
    np.testing.assert_allclose(found["point distance"], expected_m, atol=1e-6)
    assert found["point missing"].tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_evidence_of_bones_is_their_difference_in_depth(detected: Detect) -> None:
    """Bones have 0.8 of their length away from the camera for the detector, along a level sight."""
    points = detected(GUESSED, CAMERA, STATE)
    seen = observed(replace(points, spatial_m=np.zeros((len(POINT_NAMES), 3))), body=GUESSED)
    pixels, deviations, bones, away = seen.seen
    joints_m = COST.keypoints(STATE)
    for arm in (0, 1):
        bones[[2 * arm, 2 * arm + 1], :2] = 0.8, 0.9
    found = replace(seen, seen=(pixels, deviations, bones, away)).evidence(
        Posed(COST.body, STATE[None])
    )["depth difference"]
    for first in (0, 3):
        vectors = np.diff(joints_m[first : first + 3], axis=0)
        off_m = vectors @ away[0] - 0.8 * np.linalg.norm(vectors, axis=1)
        # A hand has the difference of the elbow, too; shoulders have none.
        expected = [0.0, abs(off_m[0]), abs(off_m[0] + off_m[1])]
        assert found[first : first + 3].tolist() == pytest.approx(expected)
        assert min(expected[1:]) > 0.05
