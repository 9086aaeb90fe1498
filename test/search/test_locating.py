"""Where lines of sight meet."""

from __future__ import annotations

from math import cos, sin

import numpy as np
import pytest

from cardbox_tracker.camera.view import LevelPoint
from cardbox_tracker.search.locating import crossing_of


def line(x: float, y: float, angle_rad: float) -> tuple[LevelPoint, LevelPoint]:
    """A line through (x, y)."""
    ahead_x, ahead_y = cos(angle_rad), sin(angle_rad)
    return (x - 3.0 * ahead_x, y - 3.0 * ahead_y), (ahead_x, ahead_y)


@pytest.mark.parametrize("angles", [(0.1, 1.2), (0.0, 2.0, -1.0)])
def test_lines_meet_where_they_cross(angles: tuple[float, ...]) -> None:
    lines = [line(-2.0, 0.3, angle) for angle in angles]
    np.testing.assert_allclose(crossing_of(lines, (-1.5, 0.0)), (-2.0, 0.3), atol=0.01)


def test_of_a_single_line_the_point_nearest_to_the_last_place_counts() -> None:
    one, before = line(-2.0, 0.3, 0.4), (-1.5, 0.0)
    place, ahead = (np.array(point) for point in one)
    nearest = place + ahead * ((before - place) @ ahead)
    np.testing.assert_allclose(crossing_of([one], before), nearest, atol=0.01)


def test_the_place_before_pulls_by_its_weight() -> None:
    # The weight of the place before, 0.05^2, pulls each coordinate by w / (1 + w) of its distance.
    lines = [((0.0, 0.3), (-1.0, 0.0)), ((-2.0, 5.0), (0.0, -1.0))]
    assert crossing_of(lines, (-2.0, 0.3)) == pytest.approx((-2.0, 0.3), abs=1e-12)
    pull = 0.05**2 / (1.0 + 0.05**2)
    assert crossing_of(lines, (-3.0, 0.3)) == pytest.approx((-2.0 - pull, 0.3), abs=1e-12)
