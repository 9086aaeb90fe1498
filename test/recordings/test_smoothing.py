"""The low-pass of results, filled gaps, and velocities: values that follow by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.applications.exporting.formats import Result, filtered
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.isb_angles import ANATOMICAL_NAMES
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, PLACE_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import (
    PALM_COLUMNS,
    POINT_COLUMNS,
    RATE_COLUMNS,
    SMOOTHED,
)
from cardbox_tracker.recordings.smoothing import butterworth, low_passed, rates_of
from cardbox_tracker.tracking.estimate import FILLED

RATE_HZ = 30.0
YAW = "torso_yaw"
signals = arrays(float, st.integers(1, 80), elements=st.floats(-3.0, 3.0, width=32))


def results_of(values: Sequence[float], time_s: np.ndarray | None = None) -> Results:
    """Results whose yaw has these values; images of nan have no posture."""
    yaw = np.array(values, float)
    rest, is_gap = np.where(np.isnan(yaw), np.nan, 0.0), np.isnan(yaw)
    time_s = np.arange(len(yaw)) / RATE_HZ if time_s is None else time_s
    numbers = dict.fromkeys((*JOINT_NAMES, *PLACE_NAMES, *POINT_COLUMNS), rest)
    numbers |= {YAW: yaw, f"{YAW}_stddev_rad": rest + 0.1}
    states = tuple(np.where(is_gap, "lost", "tracking").tolist())
    nobody = (None,) * len(yaw)
    stamps_ns = np.round(1e9 * time_s).astype(np.int64)
    return Results(Path("a.csv"), stamps_ns, time_s, states, numbers, {}, nobody)


@pytest.mark.parametrize(
    ("frequency_hz", "kept"),
    # tan(pi 1/30) / tan(pi 5/30) is 0.18205, and that of 10 Hz is 3.
    [(1.0, 1 / (1 + 0.41421 * 0.18205**4)), (5.0, np.sqrt(0.5)), (10.0, 1 / (1 + 0.41421 * 81))],
)
def test_a_sine_keeps_the_share_of_a_butterworth_filter_without_delay(
    frequency_hz: float, kept: float
) -> None:
    sine = np.sin(2 * np.pi * frequency_hz * np.arange(300) / RATE_HZ + 0.4)
    found = low_passed(results_of(sine), 5.0).numbers[YAW]
    np.testing.assert_allclose(found[60:-60], kept * sine[60:-60], atol=1e-5)


def test_uneven_times_are_taken_as_they_are() -> None:
    rng = np.random.default_rng(1)
    time_s = np.arange(300) / RATE_HZ + rng.uniform(-0.4, 0.4, 300) / RATE_HZ
    found = low_passed(results_of(np.sin(2 * np.pi * time_s), time_s - time_s[0]), 6.0)
    np.testing.assert_allclose(found.numbers[YAW], np.sin(2 * np.pi * time_s), atol=0.02)


@given(signals, st.floats(0.5, 13.5))
@settings(max_examples=50, deadline=None)
def test_constants_stay_and_time_may_run_backwards(values: np.ndarray, cutoff_hz: float) -> None:
    constant = np.full_like(values, values[0])
    np.testing.assert_allclose(butterworth(constant, cutoff_hz, RATE_HZ), constant, atol=1e-9)
    found = butterworth(values, cutoff_hz, RATE_HZ)
    np.testing.assert_allclose(
        butterworth(values[::-1], cutoff_hz, RATE_HZ)[::-1], found, atol=1e-9
    )


def test_a_short_gap_is_filled_and_a_long_one_stays() -> None:
    yaw = 0.01 * np.arange(60.0)
    yaw[20:23] = yaw[40:50] = np.nan
    yaw[50:] += 1.0
    found = low_passed(results_of(yaw), 6.0)
    assert [i for i, state in enumerate(found.state) if state == FILLED] == [20, 21, 22]
    assert set(found.state[40:50]) == {"lost"}
    # A line goes through the filter, and the step beyond the long gap is not seen.
    expected = np.where(np.isnan(yaw), np.nan, yaw)
    expected[20:23] = 0.01 * np.arange(20, 23)
    np.testing.assert_allclose(found.numbers[YAW], expected, atol=1e-6)
    assert low_passed(results_of(yaw), 6.0, 0.1).state[21] == "lost"


def test_deviations_grow_towards_the_middle_of_a_gap() -> None:
    time_s = np.arange(61) / RATE_HZ
    yaw = 2.0 * time_s**2
    yaw[29:32] = np.nan
    found = low_passed(results_of(yaw), 13.5).numbers[f"{YAW}_stddev_rad"]
    # The acceleration is 4 rad/s² but beside gap and ends; the middle is 2 images from both.
    assert found[28] == found[32] == 0.1
    assert found[29] == pytest.approx(found[31])
    assert found[29] < found[30]
    t = 2 / RATE_HZ
    assert found[30] == pytest.approx(np.hypot(0.1, 4.0 * t * t / 2), rel=0.02)


def test_an_angle_goes_on_beyond_half_a_turn() -> None:
    turned = 3.0 + 0.02 * np.arange(30)
    wrapped = (turned + np.pi) % (2 * np.pi) - np.pi
    assert wrapped.min() < -3.0
    found = low_passed(results_of(wrapped), 6.0)
    np.testing.assert_allclose(found.numbers[YAW], turned, atol=1e-6)
    rates = dict(zip(RATE_COLUMNS, rates_of(results_of(wrapped)).T, strict=True))
    np.testing.assert_allclose(rates[f"{YAW}_velocity_rad_s"][1:-1], 0.6)


def test_velocities_and_accelerations_of_a_parabola() -> None:
    time_s = np.array([0.0, 0.1, 0.15, 0.25, 0.3, 1.0, 1.1])
    results = results_of(3.0 * time_s**2, time_s)
    rates = dict(zip(RATE_COLUMNS, rates_of(results).T, strict=True))
    nan = np.nan
    np.testing.assert_allclose(rates[f"{YAW}_velocity_rad_s"], [nan, 0.6, 0.9, 1.5, nan, nan, nan])
    np.testing.assert_allclose(
        rates[f"{YAW}_acceleration_rad_s2"], [nan, 6.0, 6.0, 6.0, nan, nan, nan]
    )


def test_deviations_of_velocities_are_those_of_independent_errors() -> None:
    # sqrt(2) 0.1 / (2 / 30) and sqrt(6) 0.1 * 30².
    results = results_of(np.zeros(200))
    velocity, acceleration = (
        RATE_COLUMNS.index(f"{YAW}_{name}")
        for name in ("velocity_stddev_rad_s", "acceleration_stddev_rad_s2")
    )
    found = rates_of(results)[100]
    assert found[velocity] == pytest.approx(np.sqrt(2) * 0.1 * 15)
    assert found[acceleration] == pytest.approx(np.sqrt(6) * 0.1 * 900)
    # Of noise, the low-pass leaves the deviations that it says.
    noise = results_of(np.random.default_rng(3).normal(0.0, 0.1, 20_000))
    smooth = rates_of(low_passed(noise, 4.0))
    for column, stddev in ((velocity, velocity - 1), (acceleration, acceleration - 1)):
        assert smooth[100, column] == pytest.approx(np.nanstd(smooth[:, stddev]), rel=0.05)


def test_deviations_of_velocities_know_what_smoothing_left() -> None:
    before = results_of(np.zeros(200))
    smooth = replace(before, numbers={**before.numbers, SMOOTHED: np.full(200, 4.0)})
    column = RATE_COLUMNS.index(f"{YAW}_velocity_stddev_rad_s")
    frequency_hz = np.linspace(0.0, 15.0, 5000, endpoint=False)
    gain = np.sin(2.0 * np.pi * frequency_hz / RATE_HZ)
    share = np.linalg.norm(gain / (1.0 + (frequency_hz / 4.0) ** 4)) / np.linalg.norm(gain)
    found = rates_of(smooth)[100, column] / rates_of(before)[100, column]
    assert found == pytest.approx(share, rel=1e-3)


def test_other_columns_follow_the_posture() -> None:
    results = results_of(np.zeros(30))
    flat = dict.fromkeys(ANATOMICAL_NAMES, np.full(30, 5.0))
    palms = dict.fromkeys(PALM_COLUMNS, np.full(30, 1.0))
    numbers = {**results.numbers, "torso_pitch": np.full(30, 0.5), **flat, **palms}
    states = {"left_hand_state": ("hidden",) * 30}
    gap = 10
    is_gap = np.arange(30) == gap
    numbers = {name: np.where(is_gap, np.nan, of) for name, of in numbers.items()}
    texts = {name: (*of[:gap], "", *of[gap + 1 :]) for name, of in states.items()}
    found = low_passed(Results(**{**vars(results), "numbers": numbers, "texts": texts}), 6.0)
    assert found.numbers["trunk_lean_deg"][gap] == pytest.approx(np.degrees(0.5))
    assert found.numbers["left_palm_x"][gap] == pytest.approx(np.sqrt(1 / 3))
    assert found.texts["left_hand_state"][gap] == "hidden"


@pytest.mark.parametrize(
    ("cutoff_hz", "gap_s"), [(0.0, 0.2), (14.0, 0.2), (np.nan, 0.2), (6.0, -1)]
)
def test_a_wrong_cut_off_or_gap_is_told(cutoff_hz: float, gap_s: float) -> None:
    with pytest.raises(CardboxError, match=r"expected 0\.01 to 13\.5 Hz|give 0 s or more"):
        low_passed(results_of(np.zeros(30)), cutoff_hz, gap_s)


def test_images_of_another_body_are_gaps_before_the_low_pass() -> None:
    body = BodyModel.of()
    results = results_of(0.3 * np.sin(np.arange(30) / 5))
    states = np.zeros((30, 14))
    states[:, JOINT_NAMES.index(YAW)] = results.numbers[YAW]
    points = pose(body, states).keypoints_m
    points[20] += 0.5
    optical = points @ level_to_optical(body.camera_pose.pitch_rad).T
    numbers = {
        **results.numbers,
        **dict(zip(POINT_COLUMNS, optical.reshape(30, -1).T, strict=True)),
    }
    found = filtered(Results(**{**vars(results), "numbers": numbers}), 6.0, model=body)
    assert found.state[20] == FILLED
    assert found.state.count("tracking") == 29


def test_results_for_programs_are_filtered_and_have_velocities() -> None:
    result = Result(**vars(results_of(np.r_[0.0, np.nan, 0.2:2.0:0.1])))
    found = result.filtered(6.0)
    assert isinstance(found, Result)
    assert (found.cutoff_hz, found.state[1]) == (6.0, FILLED)
    np.testing.assert_allclose(found.velocities()[f"{YAW}_velocity_rad_s"][1:-1], 3.0, atol=1e-4)
    assert result.filtered(6.0, 0.0).state[1] == "lost"
