"""Exact medians without sorting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.segmentation.medians import median

NUMBERS = st.floats(0, 2.0**100, width=32) | st.sampled_from([0.0, 1.0, 1.5])


@given(arrays(np.float32, st.integers(1, 200), elements=NUMBERS))
def test_equal_to_numpy(values: np.ndarray) -> None:
    assert median(values) == np.median(values)


@pytest.mark.parametrize("size", [1, 2, 1001, 19200])
def test_equal_to_numpy_for_many(size: int) -> None:
    rng = np.random.default_rng(size)
    for values in (rng.normal(1, 0.02, size), rng.exponential(1, size), rng.integers(0, 3, size)):
        single = np.abs(values).astype(np.float32)
        assert median(single) == np.median(single)


def test_an_image_is_possible() -> None:
    assert median(np.arange(12, dtype=np.float32).reshape(3, 4)) == 5.5


@pytest.mark.parametrize("wrong", [[], [1.0, -1.0], [1.0, np.nan], [-np.inf]])
def test_what_has_no_median_is_refused(wrong: list[float]) -> None:
    with pytest.raises(ValueError, match=r"median|negative"):
        median(np.array(wrong, np.float32))
