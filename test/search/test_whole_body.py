"""The whole-body filter: where it looks, what survives, and that it stays within the limits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TORSO_X, reference_posture, state_limits
from cardbox_tracker.person.skeleton import arm_directions
from cardbox_tracker.search import arm_proposals, state_choice, torso_proposals, whole_body
from cardbox_tracker.search.config import TrackerConfig, default_preset
from cardbox_tracker.search.pose_filter import Presence
from cardbox_tracker.search.whole_body import STAGES, WholeBodyFilter
from cardbox_tracker.search.whole_body_config import ONE_CAMERA
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

STATE_LIMITS = state_limits(2.0)
CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.51)
ARM_LIMITS = np.ascontiguousarray(STATE_LIMITS[4:8])
COST = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
STIFF = WholeBodyCost(BODY.rigid, CAMERA, WholeBodyCostConfig())


def seen(posture: np.ndarray) -> np.ndarray:
    return render(cardbox_patches(BODY, posture), CAMERA)


def made(seed: int = 0, config: TrackerConfig | None = None) -> WholeBodyFilter:
    term = CompiledSilhouette(BODY, CAMERA)
    return WholeBodyFilter(config or default_preset(), term, np.random.default_rng(seed))


def follow(of: WholeBodyFilter, silhouette: np.ndarray) -> Any:
    frames = [CompiledSilhouette(BODY, CAMERA).frame(silhouette)]
    assert of.look(frames) is Presence.PERSON
    return of.follow(frames, [()])


def upright() -> np.ndarray:
    return np.append(reference_posture("front"), [0.0, 0.0])


@pytest.mark.parametrize("seed", range(3))
def test_no_state_is_outside_its_limits(seed: int) -> None:
    of = made(seed)
    for i in range(6):
        follow(of, seen(wave(i / 5.0)))
        assert np.all(of.rated.states >= STATE_LIMITS[:, 0])
        assert np.all(of.rated.states <= STATE_LIMITS[:, 1])
        assert np.all(np.isfinite(of.rated.ratings))


def test_ratings_are_those_of_the_states() -> None:
    of = made()
    follow(of, seen(wave(0.3)))
    again = of._cost.bodies(of.rated.states)
    np.testing.assert_allclose(again.ratings, of.rated.ratings, rtol=1e-12)
    np.testing.assert_array_equal(again.points.joints_m, of.rated.joints_m)
    np.testing.assert_array_equal(again.points.keypoints_m, of.rated.keypoints_m)


def test_the_best_of_a_still_person_never_becomes_worse() -> None:
    of = made()
    silhouette = seen(wave(0.4))
    best = []
    for _ in range(6):
        follow(of, silhouette)
        # Without what the motion of the torso costs, which changes from frame to frame.
        best.append(of._cost.bodies(of.rated.states).costs_px.min())
    assert best[-1] <= best[0]


def test_survivors_are_the_best_and_then_apart() -> None:
    states = np.tile(upright(), (30, 1))
    states[:, 5] += 0.001 * np.arange(30)  # all alike, but
    states[25:, 7] = 1.2 + 0.3 * np.arange(5)  # these bend an elbow
    ratings = np.arange(30.0)
    joints_m = COST.bodies(states).points.joints_m
    chosen = state_choice.choose_apart(states, ratings, joints_m, 16, 4, 0.1)
    assert chosen[:4].tolist() == [0, 1, 2, 3]
    assert chosen[4] == 25
    assert set(chosen[4:].tolist()) <= set(range(25, 30))
    alike = state_choice.choose_apart(states, ratings, joints_m, 16, 16, 0.1)
    assert alike.tolist() == list(range(16))


def arms_for(
    silhouette: np.ndarray, state: np.ndarray, arm: int, of: WholeBodyCost = COST, **counts: int
) -> np.ndarray:
    """40 proposals for an arm, of them so many mirrors, tips and banked ones."""
    rng = np.random.default_rng(0)
    of.see(silhouette, state)
    of.fix_torso(state)
    bank = np.tile([0.1, 0.2, 0.3, 0.4], (5, 1))
    kinds = [counts.get(kind, 0) for kind in ("mirrors", "tips", "banked")]
    return arm_proposals.propose_arms(
        state[None],
        arm,
        (16, 0.2, *kinds, bank, ARM_LIMITS),
        of.uncovered(arm),
        of.counted,
        of.body,
        (rng.standard_normal((40, 4)), rng.random((40, 3))),
    )


@pytest.mark.parametrize("arm", [0, 1])
def test_a_tip_puts_the_hand_on_the_pixel(arm: int) -> None:
    state = upright()
    silhouette = np.zeros((120, 160), np.uint8)
    shoulder = CAMERA.project(COST.keypoints(state)[3 * arm])
    tip = shoulder + np.array([30.0 * (1 - 2 * arm), -20.0])
    cv2.circle(silhouette, (round(tip[0]), round(tip[1])), 8, 255, -1)
    arms = arms_for(silhouette, state, arm, tips=30, of=STIFF)[-30:]
    limits = ARM_LIMITS.T
    free = [angles for angles in arms if not np.any(np.isclose(angles, limits, atol=1e-9))]
    assert len(free) > 5, "joint limits hold for the others"
    hands = []
    for angles in free:
        found = state.copy()
        found[4 + 4 * arm : 8 + 4 * arm] = angles
        hands.append(STIFF.keypoints(found)[3 * arm + 2])
    pixels = CAMERA.project(np.array(hands))
    # All at one pixel of what was uncovered, at different depths.
    np.testing.assert_allclose(pixels, np.tile(pixels[0], (len(pixels), 1)), atol=1e-6)
    assert silhouette[round(pixels[0, 1]), round(pixels[0, 0])] == 255
    assert np.ptp(np.array(hands)[:, 2]) > 0.1


def test_without_anything_uncovered_nothing_reaches() -> None:
    state = upright()
    with_tips = arms_for(np.zeros((120, 160), np.uint8), state, 0, tips=12)
    without = arms_for(np.zeros((120, 160), np.uint8), state, 0)
    np.testing.assert_array_equal(with_tips, without)


def test_the_first_proposal_is_the_best_arm_and_the_bank_is_used() -> None:
    state = upright()
    arms = arms_for(np.zeros((120, 160), np.uint8), state, 0, banked=7)
    np.testing.assert_array_equal(arms[0], state[4:8])
    np.testing.assert_array_equal(arms[-7:], np.tile([0.1, 0.2, 0.3, 0.4], (7, 1)))


@pytest.mark.parametrize("arm", [0, 1])
def test_a_mirrored_arm_points_to_the_other_side_in_depth(arm: int) -> None:
    """Far away, all lines of sight are alike: x and y of the directions stay, z turns over."""
    state = upright()
    first = 4 + 4 * arm
    state[first : first + 4] = 1.2, 0.5, 0.1, 0.4
    mirrored = arms_for(np.zeros((120, 160), np.uint8), state, arm, mirrors=20)[-20:]
    side = 1.0 - 2.0 * arm
    before = np.concatenate(arm_directions(state[first : first + 4], side))
    shoulder = COST.keypoints(state)[3 * arm]
    sight = shoulder / np.linalg.norm(shoulder)
    # Optical to torso's frame of somebody upright: X towards the camera, Y right, Z up.
    sight = np.array([-sight[2], sight[0], -sight[1]])
    kinds = set()
    for angles in mirrored:
        directions = np.concatenate(arm_directions(angles, side))
        flips = []
        for half in (slice(0, 3), slice(3, 6)):
            turned = before[half] - 2 * (before[half] @ sight) * sight
            flips.append(np.allclose(directions[half], turned, atol=1e-6))
            clipped = np.any(np.isclose(angles, ARM_LIMITS.T, atol=1e-9))
            assert flips[-1] or clipped or np.allclose(directions[half], before[half], atol=1e-6)
        kinds.add(tuple(flips))
    assert len(kinds) > 1


def test_torsos_that_turn_about_the_shoulders_leave_them_where_they_are() -> None:
    rng = np.random.default_rng(0)
    sigma = np.zeros(14)
    sigma[1:3] = 0.2
    lever_m = float(BODY.size("waist_height") + BODY.size("torso_height"))
    torsos = torso_proposals.propose_torsos(
        upright()[None],
        (sigma, STATE_LIMITS, lever_m),
        0.0,
        0,
        (0, upright(), 0.0, 0.0, 2.0),
        (rng.standard_normal((20, 14)), rng.random((20, 2))),
    )
    middle = [COST.keypoints(torso)[[0, 3]].mean(0) for torso in (upright(), *torsos)]
    moved = np.linalg.norm(np.array(middle[1:]) - middle[0], axis=1)
    # Every second one; what is left is the height they lose and a second rotation.
    assert np.median(moved[1::2]) < 0.4 * np.median(moved[::2])


def test_fixed_arms_keep_their_directions_in_space() -> None:
    before, torso = upright(), upright()
    before[4:8] = 0.9, 0.3, 0.2, 0.5
    torso[1:4] = 0.1, 0.2, 0.4
    pool = torso_proposals.pool_of(
        before[None], torso[None], np.zeros(1), 1, before, COST.body, ARM_LIMITS
    )
    carried, fixed = pool[1:]
    np.testing.assert_array_equal(carried, torso)
    np.testing.assert_array_equal(fixed[:4], torso[:4])
    arms = [np.diff(COST.keypoints(state)[:3], axis=0) for state in (before, fixed)]
    np.testing.assert_allclose(*arms, atol=1e-9)


def test_a_wider_search_starts_where_the_person_is() -> None:
    posture = reference_posture("front")
    posture[0] = 0.4
    fit = follow(made(), seen(posture))
    assert fit.posture[0] == pytest.approx(0.4, abs=0.06)


def test_too_much_and_too_little_are_seen() -> None:
    of = made()
    frame = CompiledSilhouette(BODY, CAMERA).frame
    for _ in range(40):  # it may be somebody near for long, but nobody fills the whole image
        assert of.look([frame(np.full((120, 160), 255, np.uint8))]) is Presence.TOO_MUCH
    near = np.zeros((120, 160), np.uint8)
    near[20:, 20:140] = 255
    assert [of.look([frame(near)]) for _ in range(40)][-1] is Presence.PERSON
    assert of.look([frame(np.zeros((120, 160), np.uint8))]) is Presence.NOBODY


def test_smoothing_is_a_share_of_the_last_result() -> None:
    """With a still particle cloud, as after a jump, each frame leaves so much of the old place."""
    unrefined = replace(ONE_CAMERA, refining_steps=0)
    settings = replace(default_preset().whole_body, smoothing=0.5, profile=unrefined)
    of = made(0, replace(default_preset(), whole_body=settings))
    first = follow(of, seen(wave(0.0)))
    second = follow(of, seen(wave(0.3)))
    mean, _ = state_choice.mean_and_spread(of.rated.states, of.rated.ratings, 150, 0.02)
    np.testing.assert_allclose(second.posture, 0.5 * first.posture + 0.5 * mean[:12])


def test_a_result_follows_the_outline_unless_depth_was_measured() -> None:
    of, truth = made(), upright()
    silhouette, begin = seen(truth[:12]), upright()
    begin[TORSO_X] += 0.08
    follow(of, silhouette)
    frame = CompiledSilhouette(BODY, CAMERA).frame(silhouette)
    depth_m = np.full(silhouette.shape, 2.0, np.float32)
    measured = frame.changed(channels={**frame.channels, "depth_m": depth_m})
    assert measured.depth_m is not None
    of._correction = None
    np.testing.assert_allclose(of._refined([measured], begin), begin, atol=1e-12)
    of._correction = None
    found = of._refined([frame], begin)
    assert abs(found[TORSO_X]) < 0.06 < begin[TORSO_X]
    # A part of the last correction is left, until it is forgotten.
    after = of._refined([frame], truth) - truth
    of.recover()
    alone = of._refined([frame], truth) - truth
    assert abs(alone[TORSO_X]) < 0.02
    np.testing.assert_allclose(after, 0.6 * (found - begin) + 0.4 * alone, atol=1e-12)


def test_each_stage_adds_states_to_those_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one of the cues adds nothing without cues, and with one camera fits no outlines."""
    counts: list[tuple[str, int]] = []

    def noting(stage: Any) -> Any:
        def run(of: WholeBodyFilter, search: Any) -> None:
            before = of.rated.states[:].copy() if len(of.rated.ratings) else None
            stage(of, search)
            counts.append((stage.__name__, len(of.rated.states)))
            if before is not None:
                np.testing.assert_array_equal(of.rated.states[: len(before)], before)

        return run

    monkeypatch.setattr(whole_body, "STAGES", tuple(map(noting, STAGES)))
    of = made()
    follow(of, seen(wave(0.0)))
    counts.clear()
    follow(of, seen(wave(0.1)))
    assert [name for name, _ in counts] == ["torsos", "arms", "fitted", "together"]
    torsos, arms, fitted, together = (count for _, count in counts)
    assert 0 < torsos < arms == fitted < together
    assert together - fitted == ONE_CAMERA.rounds * ONE_CAMERA.together


def test_a_result_is_judged_by_what_was_found() -> None:
    of = made()
    fit = [follow(of, seen(wave(0.0))) for _ in range(5)][-1]
    good = fit.judged.evidence
    assert fit.judged.chances.shape == (6,) and len(fit.judged.states) == 6
    assert good["residual"][0] == pytest.approx(fit.cost_px / of._cost.silhouette_px)
    assert good["left over"][0] < 0.2 and good["outside"][0] < 0.2
    assert good["cameras"].tolist() == [0.0] * 6
    assert {values.shape for values in good.values()} == {(6,)}
    crowded = seen(wave(0.0))
    crowded[20:100, 110:130] = 255
    bad = follow(of, crowded).judged.evidence
    assert bad["left over"][0] > good["left over"][0] + 0.1
