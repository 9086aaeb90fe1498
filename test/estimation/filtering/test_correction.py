"""What is learned of results moves joints, arms alike, and knows what was before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture, state_limits
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.correction import (
    DATA,
    DISPLACEMENTS,
    MIDDLE_Z,
    N_ANSWERS,
    NetworkCorrector,
    learned,
    limited,
    moved,
)
from cardbox_tracker.estimation.filtering.corrector import Result
from cardbox_tracker.estimation.filtering.loss import Evidence
from cardbox_tracker.estimation.filtering.networks import load_recurrent_network
from cardbox_tracker.estimation.filtering.packed_network import PackedNetwork
from cardbox_tracker.estimation.filtering.posing import SmoothedPosing
from cardbox_tracker.estimation.filtering.result_features import Viewpoints
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

STATE_LIMITS = state_limits(2.3)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
FRONT = np.append(reference_posture("front"), [0.0, 0.0])
STDDEV = np.full(14, 0.1)
NOBODY = Frame(np.zeros((240, 320), np.uint8), 240, 0)
ARMS = [1, 2, 4, 5]
PARENTS = [0, 1, 3, 4]
OTHER_ARM = [0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13]
MIRROR = np.array([-1, -1, 1, -1, *[1] * 10])
VIEWPOINTS = Viewpoints.of(0.0, [0.0], is_measured=True)
# Nobody is in the silhouette of COST, so only results without overlap may be moved at will.
NO_IOU = 0.0
STATES = st.lists(st.floats(0.0, 1.0), min_size=14, max_size=14).map(
    lambda shares: STATE_LIMITS[:, 0] + np.array(shares) * np.ptp(STATE_LIMITS, axis=1)
)


def search(state: np.ndarray, chance: float = 0.1) -> Search:
    """A search whose states are those around ``state``."""
    evidence = Evidence(0.1, 0.05, 0.05, 1.0, 0.0, 0.05, STDDEV, state, 100)
    states = np.array([state, state + 0.02, state - 0.02])
    keypoints_m = COST.bodies(states).points.keypoints_m
    return Search(states, np.array([0.1, 0.12, 0.12]), keypoints_m, 0.02, evidence, chance)


class Correction:
    """The learned corrector, and the body posed at its keypoints."""

    def __init__(self, smoothing_s: float = 0.0, cameras: int = 1) -> None:
        self.corrector = learned(COST, CAMERA, cameras)
        self.posing = SmoothedPosing(COST, smoothing_s)

    def __call__(
        self,
        frame: Frame,
        state: np.ndarray,
        stddev: np.ndarray,
        iou: float,
        found_by: Search,
        viewpoints: Viewpoints,
    ) -> np.ndarray:
        points_m = COST.keypoints(state)
        found = Result(frame, state, stddev, points_m, iou, found_by, viewpoints)
        return self.posing(state, self.corrector(found), frame.interval_s)


def test_joints_and_turns_are_steadied(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(_: object, features: np.ndarray, hidden: object) -> tuple[object, ...]:
        return np.zeros((2, N_ANSWERS)), np.zeros((2, N_ANSWERS)), hidden

    monkeypatch.setattr(PackedNetwork, "__call__", nothing)
    later = FRONT.copy()
    later[[0, 1, 4]] += 0.2, 0.1, 0.3
    frame = replace(NOBODY, interval_s=0.05)
    for smoothing_s, kept in ((0.0, 0.0), (0.05, np.exp(-1.0)), (0.1, 0.5)):
        correction = Correction(smoothing_s)
        for state in (FRONT, later):
            found = correction(frame, state, STDDEV, 0.9, search(state), VIEWPOINTS)
        points, before, after = (COST.keypoints(one) for one in (found, FRONT, later))
        assert found[1] == pytest.approx(kept * FRONT[1] + (1.0 - kept) * later[1])
        assert np.allclose(points, kept * before + (1.0 - kept) * after, atol=0.02)
    correction.posing.forget()
    found = correction(frame, FRONT, STDDEV, 0.9, search(FRONT), VIEWPOINTS)
    assert np.allclose(COST.keypoints(found), COST.keypoints(FRONT), atol=0.003)


def test_answers_are_beside_the_middle_of_the_shoulders_and_bones_keep_their_lengths() -> None:
    # Bones of 30 cm hang down.
    left, right = [[0.2, y, 2.0] for y in (0.0, 0.3, 0.6)], [[-0.2, y, 2.0] for y in (0, 0.3, 0.6)]
    said_left = [0.01, 0.02, 0.03, 0.0, 0.0, 0.4, 0.3, -0.3, 0.4]
    said_right = [0.03, 0.0, 0.01, 0.3, -0.3, 0.0, 0.6, -0.6, 0.0]
    found = moved(np.array([*left, *right]), np.array([said_left, said_right]))
    # In the mirror the right row's middle is 3 cm to the other side: (1 - 3) / 2 = -1 cm.
    middle = np.array([-0.01, 0.01, 0.02])
    assert np.allclose(found[[0, 3]] - middle, [left[0], right[0]])
    # 0.3 down and 0.4 away is the direction 3 : 4; the elbow comes as far as the bone is long.
    assert np.allclose(found[1] - found[0], [0.0, 0.18, 0.24])
    # The hand is said to be 0.3 aside and 0.3 down and 0.4 away of the shoulder.
    ahead = np.array([0.3, 0.3 - 0.18, 0.4 - 0.24])
    assert np.allclose(found[2] - found[1], 0.3 * ahead / np.linalg.norm(ahead))
    # The right arm is stretched aside, away from the left one.
    assert np.allclose(found[4:] - found[3], [[-0.3, 0.0, 0.0], [-0.6, 0.0, 0.0]])


@settings(max_examples=50, deadline=None)
@given(STATES, st.floats(0.0, 1.0))
def test_whatever_the_state_the_result_is_finite_and_near(state: np.ndarray, iou: float) -> None:
    found = Correction()(NOBODY, state, np.full(14, 0.2), iou, search(state), VIEWPOINTS)
    assert np.isfinite(found).all()
    assert (found >= STATE_LIMITS[:, 0]).all() and (found <= STATE_LIMITS[:, 1]).all()
    assert np.array_equal(found[1:4], state[1:4])
    points, before = COST.keypoints(found), COST.keypoints(state)
    assert np.linalg.norm(points - before, axis=1).max() < 1.2
    bones, bones_before = (np.linalg.norm(p[ARMS] - p[PARENTS], axis=1) for p in (points, before))
    assert np.allclose(bones, bones_before)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_in_the_mirror_the_correction_is_mirrored(seed: int) -> None:
    rng = np.random.default_rng(seed)
    here, there = Correction(), Correction()
    for _ in range(3):
        state = FRONT + 0.1 * rng.standard_normal(14)
        other = MIRROR * state[OTHER_ARM]
        states = MIRROR * search(state).states[:, OTHER_ARM]
        keypoints_m = COST.bodies(states).points.keypoints_m
        mirrored = search(state)._replace(states=states, keypoints_m=keypoints_m)
        found = here(NOBODY, state, STDDEV, NO_IOU, search(state), VIEWPOINTS)
        found_there = there(NOBODY, other, STDDEV, NO_IOU, mirrored, VIEWPOINTS)
        assert np.allclose(MIRROR * found[OTHER_ARM], found_there, atol=1e-4)


def test_results_come_near_what_the_network_says() -> None:
    """Bones keep their lengths, so not all the way."""
    state = FRONT.copy()
    # Where a joint is at its limit, such as a straight elbow, it cannot go on.
    state[[7, 11]] = 0.6
    correction = Correction()
    found = COST.keypoints(correction(NOBODY, state, STDDEV, NO_IOU, search(state), VIEWPOINTS))
    network = load_recurrent_network(DATA)
    answers_m, spread_m, _ = network(correction.corrector.features, network.initial_hidden(2))
    points = COST.keypoints(state)
    answers_m = limited(answers_m[:, DISPLACEMENTS], spread_m[:, DISPLACEMENTS])
    # The distance of a measured person is kept.
    answers_m[:, MIDDLE_Z] = 0.0
    wanted = moved(points, answers_m)
    off, before = (np.linalg.norm(p - wanted, axis=1).mean() for p in (found, points))
    assert off < 0.5 * before


def test_a_correction_that_leaves_the_silhouette_is_not_made() -> None:
    body = BodyModel.of(distance_m=2.3)
    cost = WholeBodyCost(body, CAMERA, WholeBodyCostConfig())
    cost.see(render(cardbox_patches(body, FRONT[:12]), CAMERA), FRONT)
    _, (differing,), (drawn,), _ = cost.bodies(FRONT[None])
    iou = iou_of(cost.silhouette_px, drawn, differing)
    assert iou > 0.8
    network = load_recurrent_network(DATA)

    def far(_: object, features: np.ndarray, hidden: object) -> tuple[object, ...]:
        answers = np.zeros((2, N_ANSWERS))
        answers[:, 0] = [0.8, -0.8]
        return answers, np.zeros((2, N_ANSWERS)), hidden

    points = cost.keypoints(FRONT)
    found = Result(NOBODY, FRONT, STDDEV, points, iou, search(FRONT), VIEWPOINTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PackedNetwork, "__call__", far)
        corrector = NetworkCorrector(cost, CAMERA, network)
        assert np.array_equal(corrector(found), points)
        # Without a fit there is nothing to lose.
        assert not np.allclose(corrector(found._replace(iou=0.0)), points)


@pytest.mark.parametrize(("yaw_deg", "is_moved"), [(0.0, True), (10.0, True), (60.0, False)])
def test_cameras_that_show_depth_are_not_corrected(yaw_deg: float, is_moved: bool) -> None:
    viewpoints = Viewpoints.of(0.0, [0.0, np.radians(yaw_deg)], True)
    points = COST.keypoints(FRONT)
    found = Result(NOBODY, FRONT, STDDEV, points, NO_IOU, search(FRONT), viewpoints)
    corrector = learned(COST, CAMERA, 2)
    assert np.allclose(corrector(found), points) != is_moved
    assert (corrector.deviations(found) is not None) == is_moved


def test_the_chance_of_error_is_that_of_the_log_odds(monkeypatch: pytest.MonkeyPatch) -> None:
    def said(_: object, features: np.ndarray, hidden: object) -> tuple[object, ...]:
        answers = np.zeros((2, N_ANSWERS))
        answers[0, 9:], answers[1, 9:] = np.log([1 / 9, 1.0, 3.0]), np.log([4.0, 99.0, 1 / 99])
        return answers, np.zeros((2, N_ANSWERS)), hidden

    monkeypatch.setattr(PackedNetwork, "__call__", said)
    corrector = learned(COST, CAMERA, 1)
    points = COST.keypoints(FRONT)
    found = Result(NOBODY, FRONT, STDDEV, points, NO_IOU, search(FRONT), VIEWPOINTS)
    corrector(found)
    assert corrector.chances_of_error() == pytest.approx([0.1, 0.5, 0.75, 0.8, 0.99, 0.01])
    apart = Viewpoints.of(0.0, [0.0, np.pi / 3], True)
    corrector(found._replace(viewpoints=apart))
    assert corrector.chances_of_error() is None


def test_what_was_before_counts() -> None:
    first, second = FRONT, np.append(reference_posture("arms"), [0.0, 0.0])
    alone = Correction()(NOBODY, second, STDDEV, NO_IOU, search(second), VIEWPOINTS)
    correction = Correction()
    correction(NOBODY, first, STDDEV, NO_IOU, search(first), VIEWPOINTS)
    assert not np.allclose(
        correction(NOBODY, second, STDDEV, NO_IOU, search(second), VIEWPOINTS), alone
    )
