"""Selection of rated states: the least ratings as a stable sort gives them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.search.state_choice import least_of

RATINGS = st.lists(st.sampled_from([-1.0, 0.0, 0.5, 2.0, np.inf]) | st.floats(-3, 3), max_size=40)


@given(RATINGS, st.integers(0, 12))
def test_the_least_ratings_are_those_of_a_stable_sort(ratings: list[float], count: int) -> None:
    values = np.array(ratings, dtype=np.float64)
    expected = np.argsort(values, kind="stable")[:count]
    np.testing.assert_array_equal(least_of(values, count), expected)


def test_ratings_that_are_not_numbers_come_last() -> None:
    values = np.array([np.nan, 2.0, np.nan, 1.0])
    assert least_of(values, 3).tolist() == [3, 1, 0]
    assert least_of(values, 2).tolist() == [3, 1]
