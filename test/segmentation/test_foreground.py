"""Foreground by contrast: by hand, and as OpenCV's images of floats have it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.segmentation.background import segment_foreground
from cardbox_tracker.segmentation.window import window_of

BRIGHTER, DARKER = 0.1, -0.05


def found(difference: np.ndarray, edge: float) -> np.ndarray:
    """Ten grey levels brighter or twenty darker make a score of 1."""
    values = difference.astype(np.float32)
    return segment_foreground(
        values,
        np.full_like(values, BRIGHTER),
        np.full_like(values, DARKER),
        edge,
        np.empty_like(values),
    )[0]


@pytest.mark.parametrize(
    ("difference", "white"), [(9.9, 0), (10.1, 255), (-19.9, 0), (-20.1, 255), (0.0, 0)]
)
def test_each_sign_has_its_limit(difference: float, white: int) -> None:
    assert found(np.array([[difference]]), 0.0).item() == white


def test_a_pixel_beside_a_strong_contrast_must_reach_a_part_of_it() -> None:
    difference = np.zeros((3, 5))
    difference[0, 0] = 100.0  # score 10
    difference[1] = [39.0, 41.0, 39.0, 0.0, -50.0]
    expected = np.zeros((3, 5), np.uint8)
    expected[0, 0] = expected[1, 1] = expected[1, 2] = expected[1, 4] = 255
    np.testing.assert_array_equal(found(difference, 0.4), expected)


@settings(max_examples=100, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(st.integers(1, 20), st.integers(1, 40)),
    st.floats(0.0, 1.0, width=32),
)
def test_equal_to_passes_of_opencv(seed: int, shape: tuple[int, int], edge: float) -> None:
    rng = np.random.default_rng(seed)
    difference = rng.normal(0, 20, shape).astype(np.float32)
    brighter = (1 / rng.uniform(2, 20, shape)).astype(np.float32)
    darker = (-1 / rng.uniform(2, 40, shape)).astype(np.float32)
    score = np.maximum(difference * brighter, difference * darker)
    around = np.asarray(cv2.dilate(score, np.ones((3, 3), np.uint8))).reshape(shape)
    limit = np.maximum(around * np.float32(edge), np.float32(1))
    made, window = segment_foreground(difference, brighter, darker, edge, np.empty_like(score))
    np.testing.assert_array_equal(made, np.where(score >= limit, 255, 0))
    assert window == window_of(made)
