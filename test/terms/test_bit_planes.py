"""Silhouettes as bits: words by hand, and every function beside its definition in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.terms.bit_planes import (
    PIXELS,
    Planes,
    fill_planes,
    leave_out,
    median_column,
    new_planes,
)

NO_WORDS = np.zeros((1, 0), np.uint64)
SIZES = [(1, 1), (40, 9), (31, 16), (62, 17), (320, 5)]
"""Widths and rows."""


def words_of(silhouette: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """The same memory eight pixels at a time, if the width allows it."""
    return silhouette.view(np.uint64) if silhouette.shape[1] % 8 == 0 else NO_WORDS


def values_of(planes: Planes, size: tuple[int, int]) -> NDArray[np.int64]:
    """1 - 2 f of each pixel, and 0 where it does not count, (rows, W)."""
    width, rows = size
    columns = np.arange(width)
    bits = planes[:, columns // PIXELS, :rows] >> np.uint32(columns % PIXELS)[None, :, None]
    counted, seen = (bits & 1).astype(int)
    values: NDArray[np.int64] = (counted - 2 * seen).T
    return values


def test_words_by_hand() -> None:
    """A word has 31 pixels, the lowest bit is the left one, and pixels that do not count are 0."""
    silhouette = np.zeros((2, 40), np.uint8)
    silhouette[0, [0, 2, 30, 31]] = 255
    silhouette[1, 34] = 255
    planes = new_planes(40, 2)
    assert fill_planes(silhouette, words_of(silhouette), planes) == 5
    assert planes.shape == (2, 2, 16)
    assert planes[0, :, :2].tolist() == [[2**31 - 1, 2**31 - 1], [2**9 - 1, 2**9 - 1]]
    assert planes[1, :, :2].tolist() == [[2**30 + 0b101, 0], [1, 2**3]]
    assert leave_out(planes, 1, 2, 33, 40) == 1
    assert planes[:, 1, :2].tolist() == [[2**9 - 1, 0b11], [1, 0]]


@pytest.mark.parametrize("size", SIZES)
@given(seed=st.integers(0, 10**6))
def test_planes_are_those_of_the_pixels(size: tuple[int, int], seed: int) -> None:
    """Eight pixels at a time or one by one, also if foreground is 1 or 128 instead of 255."""
    width, rows = size
    rng = np.random.default_rng(seed)
    silhouette = rng.choice(np.array([0, 0, 1, 128, 255], np.uint8), (rows, width))
    foreground = silhouette > 0
    values = 1 - 2 * foreground.astype(int)
    for words in (words_of(silhouette), NO_WORDS):
        planes = new_planes(width, rows)
        assert fill_planes(silhouette, words, planes) == foreground.sum()
        np.testing.assert_array_equal(values_of(planes, size), values)

    first, last = sorted(rng.integers(0, rows + 1, 2).tolist())
    start, end = sorted(rng.integers(0, width + 1, 2).tolist())
    assert leave_out(planes, first, last, start, end) == foreground[first:last, start:end].sum()
    values[first:last, start:end] = 0
    np.testing.assert_array_equal(values_of(planes, size), values)

    fours = values[::8, : width // 4 * 4].reshape(len(values[::8]), width // 4, 4).sum(axis=2)
    columns = np.sort(np.nonzero(fours < 0)[1])
    if len(columns):
        middle = 4.0 * columns[(len(columns) - 1) // 2] + 2.0
        assert median_column(planes, rows, width) == middle
