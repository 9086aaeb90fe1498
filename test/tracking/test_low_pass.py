"""The low-pass filter that steadies results."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.tracking.head import LowPass


def test_a_step() -> None:
    low_pass = LowPass(0.1)
    assert low_pass(np.array([0.0, 2.0]), 0.08).tolist() == [0.0, 2.0]
    kept = exp(-0.8)
    assert low_pass(np.array([1.0, 2.0]), 0.08) == pytest.approx([1.0 - kept, 2.0])
    # As long after as the time constant is, 1/e of the difference is left.
    assert low_pass(np.array([1.0, 2.0]), 0.1) == pytest.approx([1.0 - kept * exp(-1.0), 2.0])


def test_nothing_changes_without_a_time_constant() -> None:
    low_pass = LowPass(0.0)
    for value in (1.0, -4.0, 7.0):
        assert low_pass(np.array([value]), 0.05).tolist() == [value]


def test_what_was_forgotten_does_not_count() -> None:
    low_pass = LowPass(1.0)
    low_pass(np.array([5.0]), 0.05)
    low_pass.forget()
    assert low_pass(np.array([1.0]), 0.05).tolist() == [1.0]


@given(
    interval_s=st.floats(0.005, 0.2), time_constant_s=st.floats(0.01, 0.3), pace=st.floats(-3, 3)
)
def test_an_even_change_comes_later_by_what_the_docstring_says(
    interval_s: float, time_constant_s: float, pace: float
) -> None:
    low_pass, found = LowPass(time_constant_s), np.zeros(1)
    frames = 1 + round(30 * time_constant_s / interval_s)
    for i in range(frames):
        found = low_pass(np.array([pace * interval_s * i]), interval_s)
    kept = min(exp(-interval_s / time_constant_s), 0.5)
    late_s = interval_s * kept / (1.0 - kept)
    assert found[0] == pytest.approx(pace * (interval_s * (frames - 1) - late_s), abs=1e-6)
    assert late_s <= min(time_constant_s, interval_s) + 1e-12


def test_a_half_is_kept_at_most() -> None:
    low_pass = LowPass(0.1)
    # exp(-0.5) would be 0.61.
    found = [low_pass(np.array([value]), 0.05)[0] for value in (0.0, 1.0, 1.0, 1.0)]
    assert found == [0.0, 0.5, 0.75, 0.875]


@given(
    rate=st.sampled_from([15.0, 30.0, 60.0]),
    time_constant_s=st.floats(0.0, 1.0),
    pace=st.floats(0.01, 3.0),
)
def test_a_ramp_is_at_most_one_interval_late(
    rate: float, time_constant_s: float, pace: float
) -> None:
    low_pass = LowPass(time_constant_s)
    ramp = pace * np.arange(60) / rate
    found = np.array([low_pass(np.array([value]), 1.0 / rate)[0] for value in ramp])
    late_s = (ramp - found) / pace
    assert (late_s >= -1e-9).all() and (late_s <= 1.0 / rate + 1e-9).all()
