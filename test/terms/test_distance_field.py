"""Signed distances from the outline of a mask."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.terms.distance_field import FAR, padded_width, signed_distances_of


def padded(mask: NDArray[np.uint8]) -> NDArray[np.float32]:
    height, width = mask.shape
    found = np.full((height, padded_width(width)), np.nan, np.float32)
    signed_distances_of(mask, found)
    return found


def distances(mask: NDArray[np.uint8]) -> NDArray[np.float32]:
    return padded(mask)[:, FAR : FAR + mask.shape[1]]


def by_definition(mask: NDArray[np.uint8]) -> NDArray[np.float64]:
    v, u = np.indices(mask.shape)
    found = np.empty(mask.shape)
    for y, x in np.ndindex(*mask.shape):
        others = mask != mask[y, x]
        nearest = np.hypot(v[others] - y, u[others] - x).min() if others.any() else np.inf
        found[y, x] = min(nearest, FAR) * (-1.0 if mask[y, x] else 1.0)
    return found


def test_a_single_pixel() -> None:
    mask = np.zeros((5, 7), np.uint8)
    mask[1, 2] = 1
    found = distances(mask)
    assert found[1, 2] == pytest.approx(-1.0)
    assert found[1, 4] == pytest.approx(2.0)
    # 3 px below and 4 px to the right.
    assert found[4, 6] == pytest.approx(5.0)


@pytest.mark.parametrize("value", [0, 1])
def test_where_all_is_one_side_it_is_far_away(value: int) -> None:
    mask = np.full((4, 30), value, np.uint8)
    assert np.all(distances(mask) == (-FAR if value else FAR))


@settings(max_examples=60, deadline=None)
@given(
    height=st.integers(1, 26),
    width=st.integers(1, 26),
    share=st.sampled_from([0.01, 0.1, 0.5, 0.97]),
    seed=st.integers(0, 10_000),
)
def test_they_are_euclidean(height: int, width: int, share: float, seed: int) -> None:
    mask = np.asarray(np.random.default_rng(seed).random((height, width)) < share, np.uint8)
    assert np.allclose(distances(mask), by_definition(mask), atol=1e-4)


def test_beside_the_mask_its_outermost_columns_continue() -> None:
    mask = np.zeros((4, 3), np.uint8)
    mask[1:, 2] = 1
    found = padded(mask)
    assert found.shape[1] >= 3 + 2 * FAR
    # 3 px to the left of the foreground, and so on up to the limit.
    assert found[3, FAR - 1] == pytest.approx(3.0)
    assert found[3, 0] == pytest.approx(FAR)
    # To its right the foreground continues, whose nearest background is above.
    np.testing.assert_allclose(found[:, FAR + 4], [1.0, -1.0, -2.0, -3.0])
    np.testing.assert_allclose(found[:, -1], [1.0, -1.0, -2.0, -3.0])
    assert np.isfinite(found).all()
