"""A number that misses a bound never reads like the bound."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.measuring.references import rounded_down, rounded_up


@given(st.integers(1, 99), st.floats(1e-6, 0.3))
def test_rounding_never_reaches_a_bound_that_is_missed(percent: int, by: float) -> None:
    bound = percent / 100
    assert float(rounded_down(bound - by)) < bound < float(rounded_up(bound + by))


@given(st.integers(0, 300))
def test_a_bound_that_is_met_is_told_as_it_is(percent: int) -> None:
    assert rounded_down(percent / 100) == rounded_up(percent / 100) == f"{percent / 100:.2f}"
