"""Where lines of sight meet."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.locating import crossing_of


def line(x: float, y: float, angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """A line through (x, y)."""
    ahead = np.array([np.cos(angle_rad), np.sin(angle_rad)])
    return np.array([x, y]) - 3.0 * ahead, ahead


@pytest.mark.parametrize("angles", [(0.1, 1.2), (0.0, 2.0, -1.0)])
def test_lines_meet_where_they_cross(angles: tuple[float, ...]) -> None:
    lines = [line(-2.0, 0.3, angle) for angle in angles]
    before = np.array([-1.5, 0.0])
    np.testing.assert_allclose(crossing_of(lines, before), (-2.0, 0.3), atol=0.01)


def test_of_a_single_line_the_point_nearest_to_the_last_place_counts() -> None:
    place, ahead = line(-2.0, 0.3, 0.4)
    before = np.array([-1.5, 0.0])
    nearest = place + ahead * ((before - place) @ ahead)
    np.testing.assert_allclose(crossing_of([(place, ahead)], before), nearest, atol=0.01)
