"""The refiner: outlines and points of one camera or two lead to the true state, within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.least_squares import Residuals
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints, LegPoints
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import PITCH, TORSO_X, TORSO_Z, reference_posture, state_limits
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.search.mirroring import mirrored_states
from cardbox_tracker.search.refiner import Cue, Prior, Refiner
from cardbox_tracker.terms import joint_points_kernels as kernels
from cardbox_tracker.terms.joint_points import JointPoints
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Frame, Posed, TermObservation
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

Detect = Callable[..., ImagePoints]

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, 0.1)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=0.1)
LOW, HIGH = state_limits(2.3).T
TRUTH = np.append(reference_posture("arms"), [0.0, 0.0])
TRUTH[[5, 7, 9, 11]] = 0.4
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
LOOSE = np.full(14, 0.2**-2)
OFF = st.lists(st.floats(-0.15, 0.15), min_size=14, max_size=14)
_FINER = 8


def beside() -> View:
    """A camera 1.2 rad round to the person's left."""
    c, s = np.cos(1.2), np.sin(1.2)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    centre = np.array([0.0, 0.2, 2.3]) + 2.3 * turn.T @ [0.0, -0.1, -1.0]
    camera = replace(CAMERA, pitch_rad=0.0)
    return View.of(BODY, CAMERA, OtherCamera(camera, Extrinsics(turn, -turn @ centre)))


VIEW = beside()


class Seen:
    """A cost with drawn silhouettes of a state, and its refiner."""

    def __init__(self, state: np.ndarray = TRUTH, views: Sequence[View] = ()) -> None:
        self.cost = MultiViewCost(BODY, CAMERA, views, WholeBodyCostConfig())
        self.refine = Refiner(self.cost, views)
        silhouettes = [
            drawn(camera, one.corners(to_view(state)))
            for camera, one, to_view in zip(
                (CAMERA, *(view.camera for view in views)),
                self.cost.costs,
                self.cost.to_views,
                strict=True,
            )
        ]
        self.cost.see(silhouettes, state)
        self.cost.choose(range(len(silhouettes)))

    def outlines(self, state: np.ndarray, cameras: Sequence[int] = (0, 1)) -> list[Cue]:
        return [cue for cue in self.cost.outlines(state) if cue[0] in cameras]

    def error_m(self, state: np.ndarray, truth: np.ndarray = TRUTH) -> float:
        apart = self.cost.costs[0].keypoints(state) - self.cost.costs[0].keypoints(truth)
        return float(np.linalg.norm(apart, axis=1).mean())


def drawn(camera: Camera, corners_m: np.ndarray) -> np.ndarray:
    """The silhouette (H, W) of patches; large at first, for a polygon is filled with its border."""
    large = np.zeros((_FINER * camera.height, _FINER * camera.width), np.uint8)
    for patch in camera.project(corners_m):
        cv2.fillConvexPoly(large, cv2.convexHull(np.int32(_FINER * (patch + 0.5))), 255)
    shares = cv2.resize(large, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.where(shares > 127, 255, 0).astype(np.uint8)


def points_cue(points: ImagePoints, number: int = 0) -> Cue:
    body, camera = (BODY, CAMERA) if number == 0 else (VIEW.body, VIEW.camera)
    channels = {"silhouette": np.zeros((240, 320), np.uint8), "points": points}
    seen = JointPoints().build(body, camera).observe(Frame(camera, channels, 240, 1000))
    assert seen is not None
    return number, seen


def near(off: list[float]) -> np.ndarray:
    """A state at most 9 degrees and 7 cm from the truth."""
    scale = np.ones(14)
    scale[[0, 12, 13]] = 0.5
    return np.asarray(np.clip(TRUTH + scale * off, LOW, HIGH))


@pytest.mark.parametrize(
    "wrong",
    [{12: 0.08}, {12: -0.08}, {0: 0.05}, {1: 0.06}, {4: 0.1, 8: -0.1}, {12: 0.06, 13: 0.03}],
    ids=str,
)
def test_the_outline_leads_nearer_to_the_truth(wrong: dict[int, float]) -> None:
    seen, begin = Seen(), TRUTH.copy()
    for joint, off in wrong.items():
        begin[joint] += off
    (found,), _ = seen.refine(begin[None], seen.outlines(begin), Prior(begin, LOOSE), 5)
    assert seen.error_m(found) < 0.85 * seen.error_m(begin)


def test_what_hair_adds_is_not_followed() -> None:
    seen = Seen()
    silhouette = drawn(CAMERA, seen.cost.costs[0].corners(TRUTH))
    rows, columns = np.nonzero(silhouette)
    top, middle = int(rows.min()), int(np.median(columns[rows == rows.min()]))
    cv2.circle(silhouette, (middle, top), 18, 255, -1)
    seen.cost.see([silhouette], TRUTH)
    (found,), _ = seen.refine(TRUTH[None], seen.outlines(TRUTH), Prior(TRUTH, LOOSE), 3)
    assert seen.error_m(found) < 0.03


def test_a_second_camera_shows_what_the_first_one_does_not() -> None:
    """An arm forward, wrong by what the first camera hardly sees."""
    truth = np.append(reference_posture("arms"), [0.0, 0.0])
    truth[5] += 0.3
    seen, begin = Seen(truth, [VIEW]), truth.copy()
    begin[[3, 5, 12]] += 0.1, 0.2, 0.06
    errors = {}
    for cameras in ((0,), (1,), (0, 1)):
        cues = seen.outlines(begin, cameras)
        (found,), _ = seen.refine(begin[None], cues, Prior(begin, LOOSE), 6)
        errors[cameras] = seen.error_m(found, truth)
    assert errors[0, 1] < 0.4 * min(errors[0,], errors[1,])
    assert errors[0, 1] < 0.015
    # The first camera alone is what one camera is.
    one = Seen(truth)
    (alone,), _ = one.refine(begin[None], one.outlines(begin), Prior(begin, LOOSE), 6)
    assert one.error_m(alone, truth) == pytest.approx(errors[0,], abs=1e-12)


@pytest.mark.parametrize("level", [0, 255])
def test_nobody_and_everything_change_nothing(level: int) -> None:
    seen = Seen()
    seen.cost.see([np.full((240, 320), level, np.uint8)], TRUTH)
    (found,), _ = seen.refine(TRUTH[None], seen.outlines(TRUTH), Prior(TRUTH, LOOSE), 2)
    np.testing.assert_allclose(found, TRUTH, atol=1e-6)


def test_without_steps_the_states_stay() -> None:
    begin, seen = near([0.1] * 14), Seen()
    found, _ = seen.refine(begin[None], seen.outlines(begin), Prior(begin, LOOSE), 0)
    np.testing.assert_array_equal(found, begin[None])


def test_of_two_cameras_one_may_have_no_points(detected: Detect) -> None:
    """The other one alone leads to where it sees the person, whichever it is."""
    wanted, seen = near([0.1] * 14), Seen(views=[VIEW])
    there = detected(VIEW.body, VIEW.camera, VIEW.states(wanted), 1.0)
    for cue in (points_cue(detected(BODY, CAMERA, wanted, 1.0)), points_cue(there, 1)):
        found = TRUTH[None]
        for _ in range(10):
            found, _ = seen.refine(found, [cue], Prior(found, LOOSE), 2)
        to_view, one = seen.cost.to_views[cue[0]], seen.cost.costs[cue[0]]
        pixels = [Posed(one.body, to_view(x)).keypoints_px for x in (found, wanted[None])]
        assert np.abs(pixels[0] - pixels[1]).max() < 2.5


@settings(max_examples=30, deadline=None)
@given(off=OFF)
def test_a_state_nearby_is_found_from_its_points_but_for_the_depth(
    detected: Detect, off: list[float]
) -> None:
    wanted, seen = near(off), Seen()
    cues = [points_cue(detected(BODY, CAMERA, wanted, 1.0))]
    found = TRUTH[None]
    for _ in range(6):
        found, _ = seen.refine(found, cues, Prior(found, LOOSE), 2)

    def pixels(state: np.ndarray) -> np.ndarray:
        placed = np.empty((kernels.N_POINTS, 3))
        kernels.project(state, seen.cost.body, placed)
        return placed[:, :2]

    apart_px = np.linalg.norm(pixels(found[0]) - pixels(wanted), axis=1)
    # A deviation is 3 px at an elbow, and 7 px at hips and ears.
    assert apart_px[: kernels.HIPS].max() < 2.0
    assert apart_px[kernels.HIPS :].max() < 5.0


@settings(max_examples=20, deadline=None)
@given(off=OFF)
def test_points_of_two_cameras_give_the_depth_as_well(detected: Detect, off: list[float]) -> None:
    wanted, seen = near(off), Seen(views=[VIEW])
    there = VIEW.states(wanted)
    cues = [
        points_cue(detected(BODY, CAMERA, wanted, 1.0)),
        points_cue(detected(VIEW.body, VIEW.camera, there, 1.0), 1),
    ]
    found = TRUTH[None]
    for _ in range(8):
        found, _ = seen.refine(found, cues, Prior(found, LOOSE), 2)
    assert seen.error_m(found[0], wanted) < 0.02


@settings(max_examples=30, deadline=None)
@given(off=OFF, wrong_px=st.floats(-1e6, 1e6))
def test_a_result_is_finite_and_within_the_limits_and_costs_no_more_than_its_begin(
    detected: Detect, off: list[float], wrong_px: float
) -> None:
    seen, points = Seen(), detected(BODY, CAMERA, near(off), 1.0)
    px = points.px.copy()
    px[POINT_INDEX["left_wrist"]] = wrong_px, -wrong_px
    begin = np.array([TRUTH, FRONT])
    cues = [points_cue(replace(points, px=px)), *seen.outlines(TRUTH)]
    prior = Prior(begin.copy(), LOOSE)
    found, information = seen.refine(begin, cues, prior, 3)
    assert (found >= LOW).all() and (found <= HIGH).all()
    assert np.isfinite(information).all()
    np.testing.assert_array_equal(begin, [TRUTH, FRONT])

    def costs(states: np.ndarray) -> np.ndarray:
        posed = Posed(seen.cost.body, states)
        away = ((states - prior.mean) ** 2 * prior.inverse).sum(axis=1)
        return away + sum(cue.residuals(posed).costs for _, cue in cues)

    assert (costs(found) <= costs(begin) + 1e-9).all()


class _Straight(TermObservation):
    """A state's first value should be 0.3, with a deviation of 0.1; by hand."""

    def residuals(self, posed: Posed) -> Residuals:
        values = (posed.states[:, :1] - 0.3) / 0.1
        jacobian = np.zeros((len(posed), 1, 14))
        jacobian[:, 0, 0] = 10.0
        return Residuals(values, jacobian, values[:, 0] ** 2)


def test_a_linear_cue_and_a_prior_meet_where_their_variances_say() -> None:
    seen, inverse = Seen(), np.full(14, 1.0 / 0.2**2)
    (found,), (information,) = seen.refine(
        FRONT[None], [(0, _Straight())], Prior(FRONT, inverse), 3
    )
    # Inverse variances of 100 at 0.3 and of 25 at 0.
    assert found[0] == pytest.approx(0.3 * 100.0 / 125.0)
    np.testing.assert_allclose(found[1:], FRONT[1:], atol=1e-12)
    assert information[0, 0] == pytest.approx(125.0)
    assert information[5, 5] == pytest.approx(25.0)


@settings(max_examples=60)
@given(
    arms=st.lists(st.floats(0.1, 0.9), min_size=8, max_size=8),
    torso=st.lists(st.floats(-0.2, 0.2), min_size=4, max_size=4),
)
def test_mirror_images_have_almost_the_same_pixels(arms: list[float], torso: list[float]) -> None:
    body = MultiViewCost(BODY, CAMERA, (), WholeBodyCostConfig()).body
    state = FRONT.copy()
    state[:4] = torso
    # Where both angles are far from their limits, so are those of a mirror image.
    state[4:12] = LOW[4:12] + (0.25 + 0.5 * np.array(arms)) * (HIGH[4:12] - LOW[4:12])
    images = mirrored_states(state, body, ARM_LIMITS)
    assert images.shape == (16, 14)
    np.testing.assert_allclose(images[0], state, atol=1e-9)
    # Only the arms are mirrored.
    trunk = [0, 1, 2, 3, 12, 13]
    np.testing.assert_array_equal(images[:, trunk], np.tile(state[trunk], (16, 1)))
    inside = (images > LOW).all(axis=1) & (images < HIGH).all(axis=1)
    pixels = Posed(body, images).keypoints_px
    # Half an arm's length nearer, everything is a fifth larger.
    assert np.linalg.norm(pixels[inside] - pixels[0], axis=2).max() < 20.0


@pytest.mark.parametrize(
    ("lower_m", "pitch_deg"), [(0.4, 35.0), (0.35, 5.0), (0.02, 60.0)], ids=["squat", "sit", "bow"]
)
def test_points_show_who_squats_from_a_standing_state(
    detected: Detect, lower_m: float, pitch_deg: float
) -> None:
    """Hips that had to stay at their height would be taken for nearer ones."""
    wanted = FRONT.copy()
    wanted[PITCH], wanted[TORSO_Z] = np.radians(pitch_deg), -lower_m
    seen = Seen(FRONT)
    seen.cost.expect(0.0, 0.0, 0.0, 0.0, is_located=True, shows_legs=True)
    hips_m = np.array(seen.cost.costs[0].hips(wanted))
    trunk_m = seen.cost.costs[0].keypoints(wanted)[[0, 3]].mean(axis=0) - hips_m
    spatial_m = np.zeros((len(POINT_NAMES), 3))
    for side, aside_m in (("left", 0.2), ("right", -0.2)):
        # The detector leans people forward by 0.1 of their trunk.
        leaning_m = trunk_m / np.linalg.norm(trunk_m) + (aside_m, 0.0, -0.1)
        spatial_m[POINT_INDEX[f"{side}_shoulder"]] = leaning_m
    legs = LegPoints(np.zeros((8, 2)), np.ones(8))
    points = replace(detected(BODY, CAMERA, wanted, 1.0), spatial_m=spatial_m, legs=legs)
    found, _ = seen.refine(FRONT[None], [points_cue(points)], Prior(*seen.cost.prior()), 12)
    assert found[0, TORSO_Z] == pytest.approx(-lower_m, abs=0.1)
    assert found[0, TORSO_X] == pytest.approx(0.0, abs=0.1)
    assert np.degrees(found[0, PITCH]) == pytest.approx(pitch_deg, abs=15.0)
    # A lean that the legs let expect draws the trunk towards it.
    seen.cost.expect(0.0, 0.0, 0.0, 0.0, np.radians(40.0), is_located=True, shows_legs=True)
    more, _ = seen.refine(FRONT[None], [points_cue(points)], Prior(*seen.cost.prior()), 12)
    assert more[0, PITCH] > found[0, PITCH] + 0.02
