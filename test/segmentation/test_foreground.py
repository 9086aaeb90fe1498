"""Foreground by contrast, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.segmentation.background import segment_foreground
from cardbox_tracker.segmentation.window import window_of

BRIGHTER, DARKER = 0.1, -0.05


def found(difference: np.ndarray, edge: float) -> np.ndarray:
    """Ten grey levels brighter or twenty darker make a score of 1."""
    values = difference.astype(np.float32)
    limits = np.full_like(values, BRIGHTER), np.full_like(values, DARKER)
    made, window = segment_foreground(values, *limits, edge)
    assert window == window_of(made)
    return made


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
