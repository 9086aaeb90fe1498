"""Estimates of recordings, each by the images before and after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import LEFT_ARM, TORSO_X, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, STATE_NAMES
from cardbox_tracker.tracking.estimate import (
    CONTRADICTED,
    FILLED,
    LOST,
    TRACKING,
    UNCERTAIN,
    Estimate,
    Place,
)
from cardbox_tracker.tracking.place import SECOND_CAMERA
from cardbox_tracker.tracking.smoother import Smoother, Smoothing

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


@pytest.mark.parametrize("frequency_hz", [0.5, 1.0, 2.0, 4.0])
def test_a_sine_keeps_the_share_of_the_low_pass_of_fourth_order(frequency_hz: float) -> None:
    # Three values that fit have 1 + 3 / 4 of the usual weight; limbs at rest are smoothed most.
    kept = 1.0 / (1.0 + (frequency_hz / 1.5) ** 4 / 1.75)
    sine = 1e-3 * np.sin(2.0 * np.pi * frequency_hz * np.arange(200) / RATE_HZ)
    found = smooth([estimate_of(state) for state in moved(sine, YAW)])
    assert {one.smoothed_hz for one in found} == {1.5}
    np.testing.assert_allclose(states_of(found)[50:-50, YAW], kept * sine[50:-50], atol=3e-5)


def test_arms_that_wave_fast_are_smoothed_less_and_keep_their_motion() -> None:
    states = np.tile(AHEAD, (120, 1))
    wave = 0.6 * np.sin(2.0 * np.pi * 2.5 * np.arange(120) / RATE_HZ)
    states[:, LEFT_ARM.start + 1] += wave
    found = smooth([estimate_of(state) for state in states])
    assert {one.smoothed_hz for one in found[45:-45]} == {4.0}
    arm = states_of(found)[45:-45, LEFT_ARM.start + 1]
    # At 4 Hz at least 0.87 of it are kept, at 1.5 Hz 0.11.
    np.testing.assert_allclose(arm - AHEAD[LEFT_ARM.start + 1], wave[45:-45], atol=0.15)


def test_an_arm_that_three_images_show_elsewhere_stays_and_one_that_moved_does_not() -> None:
    states = np.tile(AHEAD, (60, 1))
    states[20:23, LEFT_ARM] += 0.6
    states[45:, LEFT_ARM] += 0.6
    arm = states_of(smooth([estimate_of(state) for state in states]))[:, LEFT_ARM]
    assert np.abs(arm[10:40] - AHEAD[LEFT_ARM]).max() < 0.12
    np.testing.assert_allclose(arm[53:], states[53:, LEFT_ARM], atol=0.05)


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
    assert smooth(estimates, smoother=Smoother(Smoothing(0.0))) == estimates
    without = [replace(one, offset_m=None, offset_stddev_m=None) for one in estimates]
    assert smooth(without) == without


def test_what_is_half_a_second_away_hardly_counts() -> None:
    rng = np.random.default_rng(2)
    states = AHEAD + np.cumsum(rng.normal(0.0, 0.02, (150, 14)), axis=0).clip(-0.4, 0.4)
    estimates = [estimate_of(state) for state in states]
    each, whole = (
        smooth(estimates, smoother=Smoother(Smoothing(0.5, 0.0))),
        Smoother[int](Smoothing(100.0, 0.0)),
    )
    for other in smooth(estimates), smooth(estimates, smoother=whole):
        np.testing.assert_allclose(states_of(each), states_of(other), atol=2e-3)


def rates(states: FloatArray, **how: Any) -> list[Estimate]:
    return smooth(
        [estimate_of(state) for state in states],
        smoother=Smoother(Smoothing(has_rates=True, **how)),
    )


def test_rates_of_a_straight_motion_are_its_velocity_and_nothing() -> None:
    found = rates(moved(0.5 * np.arange(60) / RATE_HZ, TORSO_X))
    x = STATE_NAMES.index("torso_x")
    assert all(one.rates is not None for one in found)
    each = np.array([one.rates for one in found])
    # Limbs at rest are smoothed with 1.5 Hz; within 1 / (2 pi 1.5 Hz) = 0.106 s of its ends the
    # spline is straight, whatever the motion.
    assert np.isnan(each[[*range(4), *range(-4, 0)]]).all()
    velocity, _, acceleration, _ = each[4:-4, :, x].T
    np.testing.assert_allclose(velocity, 0.5, atol=1e-5)
    np.testing.assert_allclose(acceleration, 0.0, atol=1e-4)
    # The hands go with the hips: towards the camera, against z of a level camera.
    hand_z = len(STATE_NAMES) + 3 * KEYPOINT_NAMES.index("left_hand") + 2
    np.testing.assert_allclose(each[30, 0, hand_z], -0.5, atol=1e-4)


def test_rates_of_a_slow_sine_are_its_derivatives_and_those_of_hands_follow_the_joints() -> None:
    turn = 2.0 * np.pi * 0.5
    angle = 0.4 * np.sin(turn * np.arange(90) / RATE_HZ)
    found = rates(moved(angle, YAW))
    each = np.array([one.rates for one in found])[10:-10]
    # At 0.5 Hz the low-pass of 1.5 Hz keeps 1 / (1 + (1 / 3)^4 / 1.75).
    kept = 1.0 / (1.0 + (1.0 / 3.0) ** 4 / 1.75)
    velocity = kept * 0.4 * turn * np.cos(turn * np.arange(90) / RATE_HZ)[10:-10]
    np.testing.assert_allclose(each[:, 0, YAW], velocity, atol=0.01)
    np.testing.assert_allclose(each[:, 2, YAW], -kept * turn**2 * angle[10:-10], atol=0.15)
    points_m = np.array([one.keypoints_m for one in found]).reshape(90, -1)
    np.testing.assert_allclose(
        each[:, 0, len(STATE_NAMES) :],
        np.gradient(points_m, 1.0 / RATE_HZ, axis=0)[10:-10],
        atol=0.02,
    )


def test_two_thirds_of_the_rates_of_noise_are_within_their_deviations() -> None:
    rng = np.random.default_rng(5)
    each = np.array([one.rates for one in rates(AHEAD + rng.normal(0.0, 0.03, (400, 14)))])
    # The truth is at rest, so all that moves is error; accelerations also have what is lost of
    # fast motions, of which there are none here.
    for rate, most in ((0, 0.99), (2, 1.0)):
        error, stddev = each[:, rate], each[:, rate + 1]
        known = np.isfinite(error) & np.isfinite(stddev)
        assert 0.65 < np.mean(np.abs(error) <= stddev, where=known) <= most
        assert np.mean(np.abs(error) <= 2.0 * stddev, where=known) > 0.95
    assert np.nanmedian(each[:, 1, YAW]) < 0.6


def test_rates_turn_with_the_camera() -> None:
    found = rates(moved(0.5 * np.arange(60) / RATE_HZ, 0))[30]
    turned = found.as_camera_stands(np.pi / 2)
    assert found.rates is not None and turned.rates is not None
    hand = len(STATE_NAMES) + 3 * KEYPOINT_NAMES.index("left_hand") + np.arange(2)
    assert np.abs(found.rates[0, hand[0]]) == pytest.approx(0.5, abs=1e-4)
    np.testing.assert_allclose(np.abs(turned.rates[0, hand]), [0.0, 0.5], atol=1e-4)
    np.testing.assert_allclose(turned.rates[1, hand], found.rates[1, hand[::-1]], rtol=1e-6)
    np.testing.assert_array_equal(
        turned.rates[:, : len(STATE_NAMES)], found.rates[:, : len(STATE_NAMES)]
    )


def test_a_short_gap_is_filled_and_its_deviations_grow_to_the_middle() -> None:
    estimates = [estimate_of(state) for state in moved(np.arange(80) / RATE_HZ, TORSO_X)]
    known = [estimates[i].placed_posture for i in range(80)]
    estimates[20:25] = [NOBODY] * 5
    estimates[50:60] = [NOBODY] * 10
    # The images around the gaps are 6 and 11 steps apart.
    how = Smoothing(longest_gap_s=6 / RATE_HZ)
    found = smooth(estimates, smoother=Smoother(how))
    assert [i for i, one in enumerate(found) if one.state == FILLED] == [*range(20, 25)]
    assert found[50:60] == [NOBODY] * 10
    np.testing.assert_allclose(states_of(found[:50]), known[:50], atol=1e-5)
    stddev = [float(np.max(one.posture_stddev)) for one in found[19:26]]
    assert np.argmax(stddev) == 3 and stddev[1] < stddev[2] and stddev[5] < stddev[4]
    assert smooth(estimates)[20:25] == [NOBODY] * 5
    whole = smooth(estimates, smoother=Smoother(Smoothing(longest_gap_s=1.0)))
    assert all(one.state == FILLED for one in whole[50:60])


def test_with_a_lag_each_image_is_smoothed_with_those_until_then() -> None:
    rng = np.random.default_rng(7)
    estimates = [estimate_of(state) for state in AHEAD + rng.normal(0.0, 0.03, (60, 14))]
    for lag_s in (0.1, 0.2, 0.5):
        smoother, found = Smoother[int](Smoothing(lag_s, every_s=0.0)), list[Estimate]()
        for image, estimate in enumerate(estimates):
            for number, (one,) in smoother.add(
                image, round(1e9 * image / RATE_HZ), [estimate], [BODY]
            ):
                assert number == len(found) == image - round(lag_s * RATE_HZ)
                found.append(one)
        # The last one waits for no image that has come.
        until = smooth(estimates[:60], smoother=Smoother(Smoothing(100.0)))
        last = len(found) - 1
        np.testing.assert_allclose(
            found[last].placed_posture, until[last].placed_posture, atol=1e-3
        )


def test_images_before_cameras_were_known_to_contradict_are_doubted_but_no_others() -> None:
    place = Place(np.full(3, 0.1), 0.0, SECOND_CAMERA)
    right = replace(estimate_of(AHEAD), place=place)
    estimates = [right] * 60 + [replace(right, state=UNCERTAIN, reason=CONTRADICTED)] * 30
    seen = smooth(estimates)
    doubted = [one.reason == CONTRADICTED for one in seen]
    assert all(doubted[45:]) and not any(doubted[:30])
    for one, is_doubted in zip(seen[:60], doubted, strict=False):
        assert one.state == (UNCERTAIN if is_doubted else TRACKING)
        assert one.place is not None
        assert one.place.state == ("uncertain" if is_doubted else "tracked")


def test_a_clock_that_goes_back_ends_what_was_waited_for() -> None:
    smoother, estimates = Smoother[int](), [estimate_of(AHEAD)] * 4
    stamps_ns = [0, 100_000_000, -(10**12), 100_000_000 - 10**12]
    came = []
    for number, (stamp_ns, estimate) in enumerate(zip(stamps_ns, estimates, strict=True)):
        came.append([image for image, _ in smoother.add(number, stamp_ns, [estimate], [BODY])])
    assert came == [[], [], [0, 1], []]
    assert [image for image, _ in smoother.finish()] == [2, 3]


@given(st.lists(st.integers(0, 2), min_size=1, max_size=60), st.floats(0.1, 3.0))
@settings(max_examples=30, deadline=None)
def test_every_image_comes_once_with_everybody_who_was_there(
    comes: list[int], lag_s: float
) -> None:
    smoother, found, there = Smoother[int](Smoothing(lag_s)), list[tuple[int, list[Estimate]]](), 0
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
