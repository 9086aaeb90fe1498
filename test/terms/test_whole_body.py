"""Ratings of whole bodies: kinematics and priors by hand, pixels as the definition draws them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import clip_near, fill_convex, snap
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import angles_of_arms, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import (
    BOTTOM,
    BOTTOM_WIDTH,
    FOREARM,
    HEIGHT,
    TOP_WIDTH,
    TORSO,
    WAIST,
)
from cardbox_tracker.person.posture import JOINT_LIMITS, reference_posture
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX
from cardbox_tracker.person.skeleton import arm_directions
from cardbox_tracker.terms import whole_body_kernels as kernels
from cardbox_tracker.terms.body_priors import penetration, priors
from cardbox_tracker.terms.pose_prior import FLOOR_NATS, load_gmm, nats_of
from cardbox_tracker.terms.term import Posed, TermObservation
from cardbox_tracker.terms.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)


def somebody(**sizes_m: float) -> BodyModel:
    """The default body with other sizes."""
    sizes = DEFAULT_SIZES.copy()
    for name, size_m in sizes_m.items():
        sizes[SIZE_INDEX[name]] = size_m
    return BodyModel.of(sizes, hip_height_m=-0.4)


BODY = somebody(shoulder_breadth=0.36, upper_arm_length=0.3)
CONFIG = WholeBodyCostConfig()
LIMITS = np.vstack([JOINT_LIMITS, [[-0.9, 0.9], [-0.3, 0.3]]])
GAUSSIANS = np.ascontiguousarray(load_gmm().T)
ARM_LIMITS = np.ascontiguousarray(LIMITS[4:8])


def state(**values: float) -> np.ndarray:
    """All zero, upright with hanging arms, but for d1 etc. by number or x and z by name."""
    made = np.zeros(14)
    for name, value in values.items():
        made[{"x": 12, "z": 13}.get(name) or int(name[1:]) - 1] = value
    return made


def random_states(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    low, high = LIMITS.T.copy()
    low[0], high[0] = -0.5, 0.5
    return low + (high - low) * rng.random((count, 14))


def cost(config: WholeBodyCostConfig = CONFIG, body: BodyModel = BODY) -> WholeBodyCost:
    return WholeBodyCost(body, CAMERA, config)


def test_an_offset_moves_towards_the_camera_and_up() -> None:
    moved = cost().keypoints(state(x=0.3, z=0.1)) - cost().keypoints(state())
    np.testing.assert_allclose(moved, np.tile([0.0, -0.1, -0.3], (6, 1)), atol=1e-12)


@given(st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_angles_and_directions_are_each_others_inverse(seed: int) -> None:
    for angles in random_states(5, seed)[:, 4:8]:
        for side in (1.0, -1.0):
            directions = np.concatenate(arm_directions(angles, side))
            assert np.linalg.norm(directions[:3]) == pytest.approx(1.0)
            assert np.linalg.norm(directions[3:]) == pytest.approx(1.0)
            wide = np.array([[-10.0, 10.0]] * 4)
            back = angles_of_arms(directions[None], side, wide)[0]
            again = np.concatenate(arm_directions(back, side))
            np.testing.assert_allclose(again, directions, atol=1e-6)


def drawn(of: WholeBodyCost, one: np.ndarray) -> np.ndarray:
    """The model's pixels by the definition of camera/rasterisation.py."""
    mask = np.zeros((of.counted[0], CAMERA.width), np.uint8)
    for corners_m in of.corners(one):
        fill_convex(mask, snap(CAMERA.project(clip_near(corners_m))))
    return mask


@given(st.integers(0, 10_000), st.floats(0.5, 4.0))
@settings(max_examples=25, deadline=None)
def test_pixels_are_those_of_the_drawn_outlines(seed: int, distance_m: float) -> None:
    """Not one pixel is different: both follow the same rule."""
    body = BODY.with_values(distance_m=distance_m)
    of = cost(replace(CONFIG, legs=0.0), body)
    silhouette = np.random.default_rng(seed).integers(0, 2, (120, 160)).astype(np.uint8) * 255
    of.see(silhouette, state())
    states = random_states(4, seed)
    _, costs_px, areas_px, _ = of.bodies(states)
    for one, cost_px, area_px in zip(states, costs_px, areas_px, strict=True):
        model = drawn(of, one)
        assert area_px == np.count_nonzero(model)
        assert cost_px == np.count_nonzero(model ^ silhouette[: of.counted[0]])


def test_a_trunk_looks_as_wide_from_the_side_as_it_is_deep() -> None:
    body = somebody(torso_depth=0.1, waist_depth=0.1).with_values(distance_m=8.0)
    of = cost(body=body)
    for yaw, width_m in ((0.0, body.size("waist_width")), (np.pi / 2, 0.1)):
        corners = of.corners(state(d4=yaw))[WAIST]
        assert np.ptp(corners[:, 0]) == pytest.approx(width_m, abs=1e-3)


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
def test_a_limb_is_a_bar_as_wide_as_it_is_thick_from_everywhere(angle: float) -> None:
    of = cost()
    corners = of.corners(state(d5=0.6, d6=angle))[5]
    width_m = np.linalg.norm(corners[1] - corners[0])
    assert width_m == pytest.approx(BODY.size("upper_arm_width"))


def test_parts_beside_each_other_add_up_to_the_whole() -> None:
    """Arms beside the trunk, rated one by one, are the whole body where they do not overlap."""
    of = cost()
    one = state(d5=1.4, d9=1.4)
    person = np.zeros((120, 160), np.uint8)
    cv2.circle(person, (80, 60), 30, 255, -1)
    of.see(person, one)
    of.fix_torso(one)
    trunk = of.torsos(one[None], one)[0]
    left, right = (of.arms(one[None, 4 + 4 * k : 8 + 4 * k], k)[0][0] for k in (0, 1))
    px = of.bodies(one[None]).costs_px
    torso, left_prior, right_prior = priors(one, of.body, of._prior)
    share = px[0] / of.silhouette_px
    assert trunk == pytest.approx(share + torso)
    beside = of.silhouette_px + kernels.cover(
        one, (True, False, False), of.body, of.counted, of._seen, of._beside_trunk
    )
    both = left - left_prior + right - right_prior - beside / of.silhouette_px
    assert both == pytest.approx(share)


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_pairs_of_arms_beside_a_trunk_are_rated_as_whole_bodies(seed: int) -> None:
    of = cost()
    rng = np.random.default_rng(seed)
    of.see(rng.integers(0, 2, (120, 160)).astype(np.uint8) * 255, state())
    states = random_states(6, seed)
    states[:, [0, 1, 2, 3, 12, 13]] = states[0, [0, 1, 2, 3, 12, 13]]
    of.fix_torso(states[0])
    np.testing.assert_array_equal(of.pairs(states)[0], of.bodies(states).ratings)


def test_the_torsos_prior_by_hand() -> None:
    of = cost()
    of.see(np.full((120, 160), 255, np.uint8), state())
    anchor = np.array([0.1, 0.0, 0.14, np.radians(7.0), np.radians(20.0)])

    def prior(one: np.ndarray) -> float:
        found: float = priors(one, of.body, (anchor, *of._prior[1:]))[0]
        return found / 0.012

    def capped(square: float, cap: float) -> float:
        return cap * (1.0 - np.exp(-square / cap))

    rest = state(x=0.1)
    rest[[3, 2]] = anchor[3:]
    # Half a unit of 0.08 m from home.
    home = capped(0.25, 4.0)
    assert prior(rest) == pytest.approx(home)
    bowed, back = rest.copy(), rest.copy()
    bowed[2], back[2] = np.radians(33.0), np.radians(12.0)
    assert prior(bowed) == pytest.approx(home + capped(1.0, 9.0))
    assert prior(back) == pytest.approx(home + capped(1.0, 9.0))
    turned = rest.copy()
    turned[3] = -np.radians(21.0)
    assert prior(turned) == pytest.approx(home + capped(4.0, 9.0))
    raised = rest.copy()
    raised[13] = 0.03
    assert prior(raised) == pytest.approx(home + capped(4.0, 2.0) + capped(0.25, 4.0))
    stepped = rest.copy()
    stepped[12] = 0.22
    assert prior(stepped) == pytest.approx(capped(1.44, 2.0) + capped(1.0, 4.0))


def test_an_arms_prior_is_the_learned_one_and_what_is_inside_the_body() -> None:
    of = cost()
    free, inside = state(d5=1.0, d9=1.0), state(d5=0.3, d6=0.2, d7=-1.4, d8=0.1)

    def of_left(one: np.ndarray) -> float:
        found: float = priors(one, of.body, of._prior)[1]
        return found / 0.012

    def learned(one: np.ndarray) -> float:
        arm = pose(BODY.rigid, one[:12]).left
        limbs = [arm.elbow - arm.shoulder, arm.hand - arm.elbow]
        directions = np.concatenate([limb / np.linalg.norm(limb) for limb in limbs])
        logs = np.empty(GAUSSIANS.shape[1])
        nats = kernel(lambda vectors, rest, logs: nats_of(vectors, GAUSSIANS, rest, logs))
        return float(nats(directions, np.exp(-FLOOR_NATS), logs))

    assert of_left(free) == pytest.approx(learned(free))
    assert of_left(inside) > learned(inside) + 0.5


def test_both_arms_have_the_same_prior() -> None:
    """The same angles mirror one arm to the other, and so does the learned prior."""
    of = cost()
    for angles in np.random.default_rng(0).uniform(-1.5, 1.5, (50, 4)):
        one = state()
        one[4:8] = one[8:12] = angles
        _, left, right = priors(one, of.body, of._prior)
        assert right == pytest.approx(left)


def test_how_deep_a_point_is_inside_by_hand() -> None:
    """On the axis of the torso's middle a hand costs 1, half way to its side a half."""
    parts = cost().parts
    parts = parts.copy()
    parts[FOREARM, TOP_WIDTH] = 0.0  # no margin
    high = parts[TORSO, BOTTOM] + parts[TORSO, HEIGHT] / 2
    half = (parts[TORSO, TOP_WIDTH] + parts[TORSO, BOTTOM_WIDTH]) / 4
    far = np.array([2.0, 0.0, high])
    deep = kernel(lambda points, parts: penetration(points, parts))
    for aside, depth in ((0.0, 1.0), (half / 2, 0.5), (half * 1.1, 0.0)):
        points = np.array([far, far, [0.0, aside, high]])
        assert deep(points, parts) == pytest.approx(depth)


def test_rows_below_the_hips_count_but_not_the_legs() -> None:
    of = cost()
    person = np.full((120, 160), 255, np.uint8)
    of.see(person, state())
    hip_row = int(np.ceil(0.4 * 165 / 2.0 + 59.5))
    rows = int(np.ceil((0.4 + 0.35) * 165 / 2.0 + 59.5))
    assert of.counted[0] == min(rows, 120)
    half = 0.75 * BODY.size("waist_width") * 165 / 2.0
    legs = int(79.5 + half) - int(79.5 - half)
    assert of.silhouette_px == 160 * of.counted[0] - legs * (of.counted[0] - hip_row)


class Squares(TermObservation):
    """An observation that costs 10 px for each squared rad or metre of the parts that count."""

    def rate(self, posed: Posed) -> np.ndarray:
        counting = np.repeat(posed.parts, (4, 4, 4)).tolist() + [posed.parts[0]] * 2
        return 10.0 * np.sum(posed.states[:, counting] ** 2, axis=1)


def test_further_terms_add_their_pixels_to_torsos_arms_and_bodies() -> None:
    of = cost()
    person = np.zeros((120, 160), np.uint8)
    cv2.circle(person, (80, 60), 30, 255, -1)
    of.see(person, state())
    states = random_states(5, 3)
    arms = states[:, 4:8].copy()
    joints = of.joints(arms, 0)

    def ratings() -> list[np.ndarray]:
        of.fix_torso(states[0])
        return [
            of.torsos(states, states[0]),
            of.arms(arms, 0)[0],
            of.arms_by_points(arms, joints, 0),
            of.bodies(states)[0],
        ]

    without = ratings()
    of.terms = (Squares(), Squares())
    arm = np.sum(arms**2, axis=1)
    torso = np.sum(states[:, [0, 1, 2, 3, 12, 13]] ** 2, axis=1)
    squares = torso, arm, arm, np.sum(states**2, axis=1)
    for before, after, more in zip(without, ratings(), squares, strict=True):
        np.testing.assert_allclose(after, before + 20.0 * more / of.silhouette_px)


def test_a_term_that_rates_torsos_knows_whose_arms_raise_the_shoulders() -> None:
    of, asked = cost(), []

    class Asking(TermObservation):
        def rate(self, posed: Posed) -> np.ndarray:
            asked.append((posed.parts, posed.arms_of.copy()))
            return np.zeros(len(posed))

    of.see(np.full((120, 160), 255, np.uint8), state())
    of.terms = (Asking(),)
    states, before = random_states(3, 1), random_states(1, 2)[0]
    of.torsos(states, before)
    of.bodies(states)
    assert [parts for parts, _ in asked] == [(True, False, False), (True, True, True)]
    np.testing.assert_array_equal(asked[0][1], before[None])
    np.testing.assert_array_equal(asked[1][1], states)


def test_the_median_column_is_where_the_person_is() -> None:
    of = cost()
    for column in (30, 79, 120):
        person = np.zeros((120, 160), np.uint8)
        person[10:90, column - 10 : column + 10] = 255
        of.see(person, state())
        assert of.bearing() == pytest.approx((column - 79.5) / 165, abs=4 / 165)


def test_the_front_reference_has_the_pixels_of_the_front() -> None:
    of = cost()
    one = np.append(reference_posture("front"), [0.0, 0.0])
    of.see(np.zeros((120, 160), np.uint8), one)
    assert of.frontal_px == np.count_nonzero(drawn(of, one))


def test_intersection_over_union() -> None:
    # 30 pixels seen, 20 drawn, 10 of them in both: 30 differ, 40 are in either.
    assert iou_of(30.0, 20.0, 30.0) == 0.25
    assert iou_of(0.0, 0.0, 0.0) == 0.0
