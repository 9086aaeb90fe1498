"""The low-pass filter that steadies results."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.estimation.filtering.low_pass import LowPass


def test_a_step() -> None:
    low_pass = LowPass(0.1)
    assert low_pass(np.array([0.0, 2.0]), 0.05).tolist() == [0.0, 2.0]
    kept = exp(-0.5)
    assert low_pass(np.array([1.0, 2.0]), 0.05) == pytest.approx([1.0 - kept, 2.0])
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
    kept = exp(-interval_s / time_constant_s)
    late_s = interval_s * kept / (1.0 - kept)
    assert found[0] == pytest.approx(pace * (interval_s * (frames - 1) - late_s), abs=1e-6)
    assert late_s <= time_constant_s
