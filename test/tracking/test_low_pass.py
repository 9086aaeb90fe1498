"""The low-pass filter that steadies the direction of the head."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.tracking.head import MOST_KEPT, SMOOTHING_S, low_passed


def after(values: list[float], interval_s: float) -> list[float]:
    found = [np.array(values[:1])]
    for value in values[1:]:
        found.append(low_passed(found[-1], np.array([value]), interval_s))
    return [float(one[0]) for one in found]


def test_a_step() -> None:
    kept = exp(-1.2)
    before = low_passed(np.array([0.0, 2.0]), np.array([1.0, 2.0]), 1.2 * SMOOTHING_S)
    assert before == pytest.approx([1.0 - kept, 2.0])
    # As long after as the time constant is, 1/e of the difference is left.
    found = low_passed(before, np.array([1.0, 2.0]), SMOOTHING_S)
    assert found == pytest.approx([1.0 - kept * exp(-1.0), 2.0])


def test_a_half_is_kept_at_most() -> None:
    # exp(-0.5) would be 0.61.
    assert after([0.0, 1.0, 1.0, 1.0], 0.5 * SMOOTHING_S) == [0.0, 0.5, 0.75, 0.875]


@given(interval_s=st.floats(0.005, 0.4), pace=st.floats(-3, 3))
def test_an_even_change_comes_later_by_what_the_docstring_says(
    interval_s: float, pace: float
) -> None:
    frames = 1 + round(30 * SMOOTHING_S / interval_s) + 40
    found = after([pace * interval_s * i for i in range(frames)], interval_s)
    kept = min(exp(-interval_s / SMOOTHING_S), MOST_KEPT)
    late_s = interval_s * kept / (1.0 - kept)
    assert found[-1] == pytest.approx(pace * (interval_s * (frames - 1) - late_s), abs=1e-6)
    assert late_s <= min(SMOOTHING_S, interval_s) + 1e-12


@given(rate=st.sampled_from([2.0, 15.0, 30.0, 60.0]), pace=st.floats(0.01, 3.0))
def test_a_ramp_is_at_most_one_interval_late(rate: float, pace: float) -> None:
    ramp = pace * np.arange(60) / rate
    late_s = (ramp - after(ramp.tolist(), 1.0 / rate)) / pace
    assert (late_s >= -1e-9).all() and (late_s <= 1.0 / rate + 1e-9).all()
