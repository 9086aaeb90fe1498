"""Fits of states to a detector's points: they find the state, mirror images, and who leads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture, state_limits
from cardbox_tracker.detection.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.estimation.cost import joint_points_kernels as kernels
from cardbox_tracker.estimation.cost.joint_points import JointPoints
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.arms import ARM_LIMITS
from cardbox_tracker.estimation.filtering.mirroring import mirrored_states
from cardbox_tracker.estimation.filtering.point_fit import PointFit
from cardbox_tracker.estimation.filtering.rated_states import RatedStates
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

Detect = Callable[..., ImagePoints]

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, 0.1)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.4, camera_pitch_rad=0.1)
STATE_LIMITS = state_limits(2.3)
GUESSED = BODY.with_values(source="proportions")
CONFIG = WholeBodyCostConfig()
BEGIN = np.append(reference_posture("arms"), [0.0, 0.0])
BEGIN[[5, 7, 9, 11]] = 0.4
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
NOTHING = np.zeros((240, 320), np.uint8)
OFF = st.lists(st.floats(-0.15, 0.15), min_size=14, max_size=14)


def beside() -> View:
    """A camera 1.2 rad round to the person's left."""
    c, s = np.cos(1.2), np.sin(1.2)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    centre = np.array([0.0, 0.2, 2.3]) + 2.3 * turn.T @ [0.0, -0.1, -1.0]
    camera = replace(CAMERA, pitch_rad=0.0)
    return View.of(BODY, CAMERA, OtherCamera(camera, Extrinsics(turn, -turn @ centre)))


VIEW = beside()


class Fit:
    """A fit with the terms of one camera or two."""

    def __init__(self, body: BodyModel = BODY, views: Sequence[View] = ()) -> None:
        self.cost = MultiViewCost(body, CAMERA, views, CONFIG)
        self.fit = PointFit(self.cost, CONFIG, views)
        bodies = (body, CAMERA), *((view.body, view.camera) for view in views)
        self.terms = [[JointPoints().build(*one)] for one in bodies]

    def see(self, *points: ImagePoints | None) -> PointFit:
        """Give each camera its points; there is no state before."""
        self.cost.see([NOTHING] * len(points), FRONT)
        self.cost.choose(range(len(points)))
        frames = [Frame(NOTHING, 240, 1000, points=one) for one in points]
        self.cost.observe(frames, self.terms)
        self.fit.see()
        return self.fit

    def reached(self, begin: np.ndarray, count: int = 6) -> np.ndarray:
        """Return the state after fits that each begin at the last one's result."""
        state = begin
        for _ in range(count):
            state = self.fit.polished(state)
        return state


def pixels(state: np.ndarray) -> np.ndarray:
    placed = np.empty((kernels.N_POINTS, 3))
    kernels.project(state, MODEL, placed)
    return placed[:, :2]


MODEL = MultiViewCost(BODY, CAMERA, (), CONFIG).body


def near(off: list[float]) -> np.ndarray:
    """A state at most 9 degrees and 7 cm from BEGIN."""
    scale = np.ones(14)
    scale[[0, 12, 13]] = 0.5
    return np.asarray(np.clip(BEGIN + scale * off, *STATE_LIMITS.T))


@settings(max_examples=40)
@given(off=OFF)
def test_a_state_nearby_is_found_from_its_points_but_for_the_depth(
    detected: Detect, off: list[float]
) -> None:
    wanted, one = near(off), Fit()
    one.see(detected(BODY, CAMERA, wanted, 1.0))
    found = one.reached(BEGIN)
    apart_px = np.linalg.norm(pixels(found) - pixels(wanted), axis=1)
    # A deviation is 3 px at an elbow, and 7 px at hips and ears.
    assert apart_px[: kernels.HIPS].max() < 2.0
    assert apart_px[kernels.HIPS :].max() < 5.0
    assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()


@settings(max_examples=25)
@given(off=OFF)
def test_two_cameras_give_the_depth_as_well(detected: Detect, off: list[float]) -> None:
    wanted, two = near(off), Fit(views=[VIEW])
    there = VIEW.states(wanted)
    two.see(detected(BODY, CAMERA, wanted, 1.0), detected(VIEW.body, VIEW.camera, there, 1.0))
    found = two.reached(BEGIN, 8)
    apart_m = two.cost.keypoints(found) - two.cost.keypoints(wanted)
    assert np.linalg.norm(apart_m, axis=1).max() < 0.02


def test_a_camera_without_points_does_not_matter(detected: Detect) -> None:
    wanted = near([0.1] * 14)
    points = detected(BODY, CAMERA, wanted, 1.0)
    alone, beside_blind = Fit(), Fit(views=[VIEW])
    alone.see(points), beside_blind.see(points, None)
    np.testing.assert_array_equal(alone.reached(BEGIN), beside_blind.reached(BEGIN))
    # The second camera's points alone are as good.
    there = detected(VIEW.body, VIEW.camera, VIEW.states(wanted), 1.0)
    fit = beside_blind.see(None, there)
    assert fit.is_given
    found = beside_blind.reached(BEGIN, 10)
    kept = np.empty((kernels.N_POINTS, 3))
    seen = np.empty_like(kept)
    kernels.project(VIEW.states(found), beside_blind.cost.costs[1].body, kept)
    kernels.project(VIEW.states(wanted), beside_blind.cost.costs[1].body, seen)
    assert np.abs(kept - seen)[:, :2].max() < 2.5


def rated(cost: MultiViewCost, states: np.ndarray) -> RatedStates:
    found = RatedStates(cost, 1)
    found.add(states)
    return found


@settings(max_examples=40)
@given(off=OFF, wrong_px=st.floats(-1e6, 1e6))
def test_a_fit_is_finite_and_within_the_limits_whatever_a_point_says(
    detected: Detect, off: list[float], wrong_px: float
) -> None:
    points = detected(BODY, CAMERA, near(off), 1.0)
    px = points.px.copy()
    px[POINT_INDEX["left_wrist"]] = wrong_px, -wrong_px
    one = Fit()
    fit = one.see(replace(points, px=px))
    states = np.array([BEGIN, FRONT])
    for found in (
        fit.bodies(rated(one.cost, states)),
        fit.torsos(states, BEGIN, FRONT),
        fit.polished(BEGIN)[None],
    ):
        assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()


def test_fits_do_not_write_to_the_states_they_begin_with(detected: Detect) -> None:
    one = Fit()
    fit = one.see(detected(BODY, CAMERA, near([0.1] * 14)))
    states, before = np.array([BEGIN, FRONT]), np.array([BEGIN, FRONT])
    fit.bodies(rated(one.cost, states))
    fit.torsos(states, states[0], states[1])
    fit.polished(states[0])
    np.testing.assert_array_equal(states, before)


def test_a_fit_costs_less_than_its_begin(detected: Detect) -> None:
    """Of the fits of a hanging arm, one at least reaches the hand before the torso."""
    wanted = FRONT.copy()
    wanted[4:8] = np.radians((10.0, 30.0, -70.0, 40.0))
    one = Fit()
    fit = one.see(detected(BODY, CAMERA, wanted))
    before = one.cost.point_costs(FRONT[None])[0]
    fitted = fit.bodies(rated(one.cost, np.array([FRONT, BEGIN])))
    assert one.cost.point_costs(fitted).min() < 0.2 * before


@settings(max_examples=60)
@given(
    arms=st.lists(st.floats(0.1, 0.9), min_size=8, max_size=8),
    torso=st.lists(st.floats(-0.2, 0.2), min_size=4, max_size=4),
)
def test_mirror_images_have_almost_the_same_pixels(arms: list[float], torso: list[float]) -> None:
    state, low = FRONT.copy(), STATE_LIMITS[4:12, 0]
    state[:4] = torso
    # Where both angles are far from their limits, so are those of a mirror image.
    state[4:12] = low + (0.25 + 0.5 * np.array(arms)) * (STATE_LIMITS[4:12, 1] - low)
    images = mirrored_states(state, MODEL, ARM_LIMITS)
    assert images.shape == (16, 14)
    np.testing.assert_allclose(images[0], state, atol=1e-9)
    np.testing.assert_array_equal(
        images[:, [0, 1, 2, 3, 12, 13]], np.tile(state, (16, 1))[:, [0, 1, 2, 3, 12, 13]]
    )
    inside = (images > STATE_LIMITS[:, 0]).all(axis=1) & (images < STATE_LIMITS[:, 1]).all(axis=1)
    for image in images[inside]:
        # Half an arm's length nearer, everything is a fifth larger.
        away_px = np.linalg.norm(pixels(image) - pixels(state), axis=1)
        assert away_px.max() < 20.0


def test_a_mirrored_forearm_points_as_far_away_as_it_pointed_near() -> None:
    state = FRONT.copy()
    state[4:8] = 0.3, -0.5, 0.0, 0.9
    cost = MultiViewCost(BODY, CAMERA, (), CONFIG)
    images = mirrored_states(state, MODEL, ARM_LIMITS)
    keypoints_m = np.array([cost.keypoints(one) for one in images[:3]])
    forearms_m = keypoints_m[:, 2] - keypoints_m[:, 1]
    sight = keypoints_m[0, 1] / np.linalg.norm(keypoints_m[0, 1])
    lengths = np.linalg.norm(forearms_m, axis=1)
    np.testing.assert_allclose(lengths, lengths[0])
    np.testing.assert_allclose(forearms_m[2] @ sight, -(forearms_m[0] @ sight), rtol=1e-6)
    assert forearms_m[0] @ sight < -0.1
    # The other arm does not move.
    np.testing.assert_allclose(keypoints_m[:, 3:], keypoints_m[[0, 0, 0], 3:], atol=1e-12)


@pytest.mark.parametrize(("body", "leads"), [(BODY, False), (GUESSED, True)])
def test_points_lead_for_whom_nobody_measured(
    detected: Detect, body: BodyModel, leads: bool
) -> None:
    one, points = Fit(body), detected(body, CAMERA, FRONT)
    assert not one.fit.is_leading and not one.fit.is_given
    fit = one.see(points)
    assert (fit.is_given, fit.is_leading) == (True, leads)
    # A silhouette with which the best of all states does not agree is wrong.
    assert [fit.leads(iou) for iou in (0.9, 0.7, 0.5, 0.0)] == [leads, leads, True, True]
    assert one.see(None).leads(0.5) == leads


def test_points_lead_for_two_seconds_after_the_last_one(detected: Detect) -> None:
    one = Fit(GUESSED)
    one.see(detected(GUESSED, CAMERA, FRONT))
    states = []
    for _ in range(30):
        fit = one.see(None)
        states.append((fit.is_given, fit.is_leading))
    assert states == [(False, True)] * 29 + [(False, False)]
