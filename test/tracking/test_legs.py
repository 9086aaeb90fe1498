"""Legs from the points of a detector: angles by hand, sitting, unseen legs, lengths and floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_INDEX,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import leg_directions
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import TORSO_Y
from cardbox_tracker.person.proportions import HIP_SHARE, stature_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import LEG_LIMITS, KeypointState, rotation_z
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import Estimate, Place
from cardbox_tracker.tracking.leg_fit import points_of
from cardbox_tracker.tracking.legs import LegReader
from cardbox_tracker.tracking.place import SECOND_CAMERA

PITCH_RAD = float(np.radians(8.0))
CAMERA = Camera(480, 640, 500.0, 500.0, 239.5, 319.5, PITCH_RAD)
BODY = body_from_proportions(1.75, 3.0, hip_height_m=-0.5, camera_pitch_rad=PITCH_RAD)
STATURE_M = stature_of(body_parts(BODY.sizes))
# The middle of the mass is 5 cm ahead of the ankles.
STANDING = np.radians([-2.0, 4.0, 0.0, 4.0] * 2)
SQUATTING = np.radians([71.0, 10.0, 0.0, 105.0] * 2)
SITTING = np.radians([85.0, 10.0, 0.0, 88.0, 85.0, 8.0, 0.0, 88.0])
# Thigh and shank between the points that detectors mark.
THIGH_SHARE, SHANK_SHARE = 0.245, 0.220
# The detector's slope of a bone whose true slope is known, see the fit.
FACTORS, OFFSETS = np.array([0.93, 0.68]), np.array([-0.04, -0.08])
NO_ERROR = np.zeros(2)


def estimate(
    offset_m: tuple[float, float] = (0.0, 0.0), rests_on: str = "given stature"
) -> Estimate:
    place = Place(np.full(3, 0.1), 0.0, rests_on)
    found = Estimate(
        "tracking", np.zeros(12), np.full(12, 0.05), offset_m=np.array(offset_m), place=place
    )
    points_m = pose(found.placed(BODY), np.zeros(12)).keypoints_m
    return replace(found, keypoints_m=CAMERA.reference_to_optical(points_m))


def joints_m(
    angles: FloatArray, found: Estimate, scales: tuple[float, float] = (1.0, 1.0)
) -> FloatArray:
    """Hips, knees and ankles (2, 3, 3) in the optical frame."""
    hip = pose(found.placed(BODY), np.zeros(12)).hip
    legs = []
    for number, side in enumerate((1.0, -1.0)):
        thigh, shank = leg_directions(angles[4 * number : 4 * number + 4], side)
        first = hip + np.array([0.0, side * HIP_SHARE * STATURE_M, 0.0])
        knee = first + scales[0] * THIGH_SHARE * STATURE_M * thigh
        legs.append([first, knee, knee + scales[1] * SHANK_SHARE * STATURE_M * shank])
    return CAMERA.reference_to_optical(np.array(legs))


def seen(
    joints: FloatArray, found: Estimate, score: float = 1.0, off: FloatArray = NO_ERROR
) -> ImagePoints:
    """What a detector without noise finds of these joints, with its usual slopes.

    The slopes of thigh and shank are ``off`` by two numbers.
    """
    px, scores = np.full((len(POINT_NAMES), 2), np.nan), np.zeros(len(POINT_NAMES))
    spatial, legs_m = np.zeros((len(POINT_NAMES), 3)), np.zeros((len(LEG_POINT_NAMES), 3))
    legs_px = np.full((len(LEG_POINT_NAMES), 2), np.nan)
    legs_scores = np.zeros(len(LEG_POINT_NAMES))
    assert found.keypoints_m is not None
    for number, side in enumerate(("left", "right")):
        points_m = found.keypoints_m[3 * number], joints[number, 0]
        for name, point_m in zip(("shoulder", "hip"), points_m, strict=True):
            at = POINT_INDEX[f"{side}_{name}"]
            px[at], scores[at] = CAMERA.project(point_m), 1.0
        end = np.zeros(3)
        for part, name in enumerate(("knee", "ankle")):
            at = LEG_POINT_NAMES.index(f"{side}_{name}")
            legs_px[at], legs_scores[at] = CAMERA.project(joints[number, part + 1]), score
            bone = joints[number, part + 1] - joints[number, part]
            slope = bone[2] / np.linalg.norm(bone) + off[part]
            slope = (slope - OFFSETS[part]) / FACTORS[part]
            slope = float(np.clip(slope, -1.0, 1.0))
            end = end + np.array([0.0, np.sqrt(1.0 - slope**2), slope])
            legs_m[at] = end
    legs = LegPoints(legs_px, legs_scores, legs_m)
    return ImagePoints(px, scores, spatial_m=spatial, legs=legs)


def frame(points: ImagePoints | None) -> Frame:
    channels = {"silhouette": np.zeros((640, 480), np.uint8), "points": points}
    return Frame(CAMERA, channels, 640, 0)


def read(angles: FloatArray, found: Estimate, images: int = 10) -> Estimate:
    reader = LegReader(BODY, CAMERA)
    points = seen(joints_m(angles, found), found)
    for _ in range(images):
        result = reader.see(frame(points), found)
    return result


def test_the_compiled_legs_are_those_of_the_skeleton() -> None:
    rng = np.random.default_rng(3)
    angles, hip, aside = rng.uniform(*LEG_LIMITS.T, (20, 8)), rng.random(3), rng.random(3)
    turn, lengths = rotation_z(np.asarray(0.7)), np.array([0.4, 0.5])
    scaled = np.log([0.9, 1.1]).tolist()
    values = np.column_stack([angles, *np.tile([*scaled, 0.0, np.log(1.2)], (20, 1)).T])
    found = points_of(values, (hip, aside, turn, lengths, 0.1)).reshape(20, 2, 3, 3)
    for leg, side in enumerate((1.0, -1.0)):
        bones = leg_directions(angles[:, 4 * leg : 4 * leg + 4], side)
        assert found[:, leg, 0] == pytest.approx(np.tile(1.2 * hip + side * aside, (20, 1)))
        for part, length in enumerate((0.9 * 0.4, 1.1 * 0.5)):
            step = found[:, leg, part + 1] - found[:, leg, part]
            assert step == pytest.approx(length * bones[part] @ turn.T)


@pytest.mark.parametrize(
    ("angles", "lower_m"), [(STANDING, 0.0), (SITTING, 0.38)], ids=["standing", "sitting"]
)
def test_legs_are_found_where_they_are(angles: FloatArray, lower_m: float) -> None:
    there = estimate((0.0, -lower_m))
    legs = read(angles, there).legs
    assert legs is not None
    away_m = np.linalg.norm(legs.points_m - joints_m(angles, there).reshape(6, 3), axis=1)
    assert away_m.max() < 0.08
    bends = np.degrees(legs.angles - angles)[[0, 3, 4, 7]]
    assert np.abs(bends).max() < 12.0
    assert set(legs.states) == {KeypointState.TRACKED}


def test_straight_legs_are_straight_by_the_detectors_usual_slopes() -> None:
    straight = np.zeros(8)
    legs = read(straight, estimate(), images=1).legs
    assert legs is not None
    assert np.degrees(legs.angles) == pytest.approx(straight, abs=1.0)


def test_a_wrong_slope_is_believed_by_its_deviation() -> None:
    """That of the shank has a deviation of 0.12, that of the thigh 0.22; angles have 1 rad."""
    found = estimate()
    joints = joints_m(np.zeros(8), found)
    believed = []
    for part, off in enumerate((-0.3, 0.3)):
        points = seen(joints, found, off=off * np.eye(2)[part])
        legs = LegReader(BODY, CAMERA).see(frame(points), found).legs
        assert legs is not None
        bones = np.diff([legs.points_m[:3], joints[0]], axis=1)[:, part]
        slopes = bones[:, 2] / np.linalg.norm(bones, axis=1)
        believed.append((slopes[0] - slopes[1]) / off)
    # With the deviations exchanged, these are 0.95 and 0.51.
    assert believed == pytest.approx([0.83, 0.72], abs=0.06)


def test_a_lifted_leg_is_not_pulled_to_the_floor() -> None:
    lifted = STANDING.copy()
    lifted[:4] = np.radians([70.0, 5.0, 0.0, 80.0])
    reader, found = LegReader(BODY, CAMERA), estimate()
    for _ in range(10):
        reader.see(frame(seen(joints_m(STANDING, found), found)), found)
    result = reader.see(frame(seen(joints_m(lifted, found), found)), found)
    assert result.legs is not None
    assert np.degrees(result.legs.angles)[[0, 3, 4, 7]] == pytest.approx([70, 80, 2, 4], abs=15)


def test_what_the_detector_does_not_see_is_hidden_and_less_exact() -> None:
    reader, found = LegReader(BODY, CAMERA), estimate()
    points = seen(joints_m(STANDING, found), found)
    known = reader.see(frame(points), found).legs
    assert points.legs is not None and known is not None
    scores = points.legs.scores.copy()
    scores[LEG_POINT_NAMES.index("left_ankle")] = 0.1
    part = reader.see(frame(replace(points, legs=points.legs._replace(scores=scores))), found).legs
    assert part is not None
    assert part.states[2] == KeypointState.HIDDEN and part.states[5] == KeypointState.TRACKED
    none = reader.see(frame(None), found).legs
    assert none is not None
    assert set(none.states) == {KeypointState.HIDDEN}
    assert (none.points_stddev_m[[1, 2, 4, 5]] > known.points_stddev_m[[1, 2, 4, 5]]).all()
    assert none.angles == pytest.approx(part.angles, abs=0.2)


def test_without_a_posture_there_are_no_legs() -> None:
    lost = Estimate("lost")
    assert LegReader(BODY, CAMERA).see(frame(None), lost) is lost


def test_exchanged_sides_are_exchanged_back() -> None:
    """The tracker takes a person's back for the front; the detector does not."""
    turned = STANDING.copy()
    turned[:4] = np.radians([60.0, 5.0, 0.0, 70.0])
    found = estimate()
    points = seen(joints_m(turned, found), found).exchanged()
    legs = LegReader(BODY, CAMERA).see(frame(points), found).legs
    assert legs is not None
    assert legs.angles[3] > 0.8 and legs.angles[7] < 0.5
    assert set(legs.states) == {KeypointState.UNCERTAIN}


def test_lengths_approach_those_that_are_seen_and_do_not_run_away() -> None:
    reader, found = LegReader(BODY, CAMERA), estimate()
    joints = joints_m(STANDING, found, scales=(0.95, 1.05))
    lengths = []
    for _ in range(300):
        result = reader.see(frame(seen(joints, found)), found)
        assert result.legs is not None
        first = result.legs.points_m[:3]
        lengths.append(np.linalg.norm(np.diff(first, axis=0), axis=1) / STATURE_M)
    shares = np.array([0.95 * THIGH_SHARE, 1.05 * SHANK_SHARE])
    off = np.abs(np.array(lengths) - shares)
    assert (off[-1] < off[0]).all()
    assert np.ptp(lengths[150:], axis=0).max() < 0.005


def middle_m(result: Estimate) -> float:
    """The middle of the mass ahead of the ankles, with the shares of Winter's table 4.1."""
    assert result.legs is not None and result.keypoints_m is not None
    level = CAMERA.optical_to_reference(result.legs.points_m)[:, 0].reshape(2, 3).mean(axis=0)
    shoulders = CAMERA.optical_to_reference(np.array(result.keypoints_m))[[0, 3], 0].mean()
    hip, knee, _ = level - level[2]
    upper = hip + 0.626 * (shoulders - level[0])
    thigh, shank = hip + 0.433 * (knee - hip), 0.567 * knee
    return float(0.678 * upper + 0.2 * thigh + 0.093 * shank)


@pytest.mark.parametrize("first", [STANDING, None], ids=["stood before", "sits"])
def test_the_mass_of_who_squats_is_over_the_feet(first: FloatArray | None) -> None:
    """The hips are behind the feet as on a chair; only who stood before cannot sit there."""
    reader, found = LegReader(BODY, CAMERA), estimate()
    if first is not None:
        for _ in range(5):
            reader.see(frame(seen(joints_m(first, found), found)), found)
    low = estimate((0.0, -0.45))
    points = seen(joints_m(SQUATTING, low), low)
    for _ in range(3):
        result = reader.see(frame(points), low)
    if first is None:
        assert middle_m(result) < -0.1
        assert reader.lean_rad == 0.0
        return
    # With this lean, the middle is where that of somebody who stands is.
    hips_m = CAMERA.optical_to_reference(result.legs.points_m)[[0, 3]].mean(axis=0)
    shoulders_m = CAMERA.optical_to_reference(np.array(result.keypoints_m))[[0, 3]].mean(axis=0)
    trunk_m = np.linalg.norm(shoulders_m - hips_m)
    moved_m = trunk_m * np.sin(reader.lean_rad) - (shoulders_m - hips_m)[0]
    assert 0.1 < reader.lean_rad < 0.6
    assert middle_m(result) + 0.678 * 0.626 * moved_m == pytest.approx(0.05, abs=1e-3)
    pressed_m = middle_m(result)
    assert pressed_m > -0.06
    for _ in range(40):
        # Nobody squats so long without a motion.
        result = reader.see(frame(points), low)
    assert middle_m(result) < pressed_m - 0.02
    assert reader.lean_rad == 0.0


def test_the_floor_shows_the_distance() -> None:
    """The floor is known; then the tracker's distance of the same image is wrong by 0.12 m."""
    reader, there = LegReader(BODY, CAMERA), estimate()
    joints = joints_m(STANDING, there)
    for _ in range(60):
        reader.see(frame(seen(joints, there)), there)
    # The hips look the same from a place farther away along their ray.
    hip = pose(BODY, np.zeros(12)).hip
    moved = hip * 0.12 / abs(hip[0])
    wrong = estimate((float(moved[0]), float(moved[2])))
    points = seen(joints, there)
    result = wrong
    for _ in range(60, 90):
        result = reader.see(frame(points), wrong)
    assert result.offset_m is not None and result.posture is not None
    assert wrong.keypoints_m is not None and result.keypoints_m is not None
    assert abs(float(result.offset_m[0])) < 0.08
    assert result.posture[TORSO_Y] == pytest.approx(0.0, abs=1e-9)
    # All points of the person are moved with the hips.
    by_m = CAMERA.reference_to_optical(
        np.array([result.offset_m[0] - moved[0], 0.0, result.offset_m[1] - moved[2]])
    )
    assert result.keypoints_m - wrong.keypoints_m == pytest.approx(np.tile(by_m, (6, 1)), abs=1e-9)


def test_a_filter_with_a_constant_place_keeps_it() -> None:
    found = replace(estimate(), offset_m=None, place=None)
    points = seen(joints_m(STANDING, found), found)
    result = LegReader(BODY, CAMERA).see(frame(points), found)
    assert result.offset_m is None and result.legs is not None
    assert result.posture == pytest.approx(found.posture)


@pytest.mark.parametrize(
    ("rests_on", "left_m"), [("given stature", 0.06), (SECOND_CAMERA, 0.12)], ids=str
)
def test_a_given_floor_shows_the_distance_in_the_first_image(rests_on: str, left_m: float) -> None:
    """The tracker's distance is wrong by 0.12 m; that of two cameras is believed."""
    there = estimate()
    floor_m = BODY.placement.hip_height_m - (THIGH_SHARE + SHANK_SHARE + 0.063) * STATURE_M
    hip = pose(BODY, np.zeros(12)).hip
    moved = hip * 0.12 / abs(hip[0])
    wrong = estimate((float(moved[0]), float(moved[2])), rests_on)
    points = seen(joints_m(np.zeros(8), there), there)
    body = BODY.with_values(camera_height_m=-floor_m, height_stddev_m=0.01)
    result = LegReader(body, CAMERA).see(frame(points), wrong)
    assert result.offset_m is not None
    assert abs(float(result.offset_m[0])) == pytest.approx(left_m, abs=0.04)


def test_a_distance_that_feet_have_shown_stays_while_they_are_hidden() -> None:
    there, body = estimate(), BODY.with_values(camera_height_m=1.33, height_stddev_m=0.01)
    moved = 0.12 * pose(BODY, np.zeros(12)).hip / 3.0
    wrong = estimate((float(moved[0]), float(moved[2])))
    reader, joints = LegReader(body, CAMERA), joints_m(np.zeros(8), there)
    found = []
    for score, images in ((1.0, 30), (0.1, 90)):
        for _ in range(images):
            result = reader.see(frame(seen(joints, there, score)), wrong)
        assert result.offset_m is not None
        found.append(float(result.offset_m[0] - moved[0]))
    assert abs(found[0]) > 0.04
    assert found[1] == pytest.approx(found[0], rel=0.3)


def test_bones_are_not_longer_than_those_of_people() -> None:
    """A knee and an ankle that are another person's do not stretch the leg to them."""
    found = estimate()
    joints = joints_m(STANDING, found)
    joints[:, 1:] += (0.0, 1.0, 0.0)
    legs = LegReader(BODY, CAMERA).see(frame(seen(joints, found)), found).legs
    assert legs is not None
    thigh_m = np.linalg.norm(legs.points_m[1] - legs.points_m[0])
    assert thigh_m <= np.exp(0.12) * THIGH_SHARE * STATURE_M + 1e-6


def test_legs_that_no_points_have_shown_are_not_there() -> None:
    found = estimate()
    assert LegReader(BODY, CAMERA).see(frame(None), found) is found


def test_without_feet_the_tracker_alone_has_the_distance() -> None:
    reader, found = LegReader(BODY, CAMERA), estimate()
    points = seen(joints_m(STANDING, found, scales=(1.3, 1.3)), found, score=0.1)
    for _ in range(30):
        result = reader.see(frame(points), found)
    assert result.offset_m == pytest.approx([0.0, 0.0], abs=1e-4)
