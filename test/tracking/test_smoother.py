"""Estimates of recordings, each by the images before and after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import LEFT_ARM, TORSO_X, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.smoother import Smoother

RATE_HZ = 30.0
BODY = body_from_proportions(1.75, 2.5)
OTHER = replace(BODY, version=1)
AHEAD = np.array([0.1, 0.2, 0.3, 0.0, 0.5, 0.6, 0.4, 0.7, 0.5, 0.1, 0.2, 0.3, 0.05, -0.02])
NOBODY = Estimate(LOST)


def estimate_of(state: FloatArray, stddev: float = 0.1) -> Estimate:
    state = np.array(state, float)
    return Estimate(
        TRACKING,
        state[:12],
        np.full(12, stddev),
        pose(BODY, state, BODY.camera_pose.pitch_rad).keypoints_m,
        offset_m=state[12:],
        offset_stddev_m=np.full(2, stddev),
    )


def smooth(
    estimates: Sequence[Estimate],
    rate_hz: float = RATE_HZ,
    bodies: Sequence[BodyModel] = (),
    smoother: Smoother[int] | None = None,
) -> list[Estimate]:
    smoother, found = smoother or Smoother[int](), list[tuple[int, list[Estimate]]]()
    for image, estimate in enumerate(estimates):
        body = bodies[image] if bodies else BODY
        found += smoother.add(image, round(1e9 * image / rate_hz), [estimate], [body])
    found += smoother.finish()
    assert [image for image, _ in found] == [*range(len(estimates))]
    return [estimate for _, (estimate,) in found]


def states_of(estimates: Sequence[Estimate]) -> FloatArray:
    return np.array([estimate.placed_posture for estimate in estimates])


def moved(values: FloatArray, column: int) -> FloatArray:
    return AHEAD + np.outer(values, np.eye(14)[column])


@pytest.mark.parametrize("rate_hz", [6.0, 15.0, 30.0, 60.0])
def test_a_straight_motion_stays_and_its_keypoints_are_those_of_the_joints(rate_hz: float) -> None:
    states = moved(0.4 * np.arange(80) / rate_hz, YAW) + moved(np.arange(80) / rate_hz, TORSO_X)
    states -= AHEAD
    found = smooth([estimate_of(state) for state in states], rate_hz)
    np.testing.assert_allclose(states_of(found), states, atol=1e-6)
    points_m = pose(BODY, states, BODY.camera_pose.pitch_rad).keypoints_m
    np.testing.assert_allclose([one.keypoints_m for one in found], points_m, atol=1e-6)


@pytest.mark.parametrize("frequency_hz", [1.0, 2.0, 4.0])
def test_a_sine_keeps_the_share_of_the_low_pass_of_fourth_order(frequency_hz: float) -> None:
    # Three values that fit have 1 + 3 / 4 of the usual weight.
    kept = 1.0 / (1.0 + (frequency_hz / 4.0) ** 4 / 1.75)
    sine = 1e-3 * np.sin(2.0 * np.pi * frequency_hz * np.arange(200) / RATE_HZ)
    found = states_of(smooth([estimate_of(state) for state in moved(sine, YAW)]))[:, YAW]
    np.testing.assert_allclose(found[50:-50], kept * sine[50:-50], atol=3e-5)


def test_an_arm_that_three_images_show_elsewhere_stays_and_one_that_moved_does_not() -> None:
    states = np.tile(AHEAD, (60, 1))
    states[20:23, LEFT_ARM] += 0.6
    states[45:, LEFT_ARM] += 0.6
    arm = states_of(smooth([estimate_of(state) for state in states]))[:, LEFT_ARM]
    assert np.abs(arm[10:40] - AHEAD[LEFT_ARM]).max() < 0.12
    np.testing.assert_allclose(arm[52:], states[52:, LEFT_ARM], atol=0.05)


def test_shaking_becomes_little_and_deviations_stay_those_of_the_images() -> None:
    rng = np.random.default_rng(1)
    states = AHEAD + rng.normal(0.0, 0.03, (120, 14))
    found = smooth([estimate_of(state, 0.2) for state in states])
    before, after = (np.diff(of, 2, axis=0).std() for of in (states, states_of(found)))
    assert after < 0.1 * before
    stddevs = np.array([one.posture_stddev for one in found])
    assert stddevs.min() >= 0.2 and stddevs.max() < 0.21


def test_a_turn_of_the_tracker_another_body_and_gaps_are_no_motions() -> None:
    states = np.tile(AHEAD, (90, 1))
    states[30:, YAW] += np.pi
    states[60:, TORSO_X] += 0.5
    estimates = [estimate_of(state) for state in states]
    found = smooth(estimates, bodies=[BODY] * 60 + [OTHER] * 30)
    np.testing.assert_allclose(states_of(found), states, atol=1e-6)
    estimates[10:20] = [NOBODY] * 10
    assert smooth(estimates)[10:20] == [NOBODY] * 10


def test_without_lag_or_place_estimates_stay() -> None:
    estimates = [estimate_of(state) for state in moved(np.arange(9.0) % 2, YAW)]
    assert smooth(estimates, smoother=Smoother(0.0)) == estimates
    without = [replace(one, offset_m=None, offset_stddev_m=None) for one in estimates]
    assert smooth(without) == without


def test_what_is_half_a_second_away_hardly_counts() -> None:
    rng = np.random.default_rng(2)
    states = AHEAD + np.cumsum(rng.normal(0.0, 0.02, (150, 14)), axis=0).clip(-0.4, 0.4)
    estimates = [estimate_of(state) for state in states]
    each, whole = smooth(estimates, smoother=Smoother(0.5, 0.0)), Smoother[int](100.0, 0.0)
    for other in smooth(estimates), smooth(estimates, smoother=whole):
        np.testing.assert_allclose(states_of(each), states_of(other), atol=2e-3)


@given(st.lists(st.integers(0, 2), min_size=1, max_size=60), st.floats(0.1, 3.0))
@settings(max_examples=30, deadline=None)
def test_every_image_comes_once_with_everybody_who_was_there(
    comes: list[int], lag_s: float
) -> None:
    smoother, found, there = Smoother[int](lag_s), list[tuple[int, list[Estimate]]](), 0
    given_estimates = []
    for image, more in enumerate(comes):
        there = max(there, more)
        estimates = [estimate_of(AHEAD + 0.1 * person) for person in range(there)]
        given_estimates.append(estimates)
        found += smoother.add(image, 100_000_000 * image, estimates, [BODY] * there)
    found += smoother.finish()
    assert [image for image, _ in found] == [*range(len(comes))]
    for (_, after), before in zip(found, given_estimates, strict=True):
        assert len(after) == len(before)
        for one, other in zip(after, before, strict=True):
            np.testing.assert_allclose(one.placed_posture, other.placed_posture, atol=1e-6)
