"""Farthest uncovered foreground: by hand on a bar beside a covered body."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.search.arm_proposals import farthest_uncovered
from cardbox_tracker.terms.bit_planes import Planes, fill_planes, leave_out, new_planes

SIZE = ROWS, WIDTH = 60, 160


def bar(begin: int, end: int) -> Planes:
    """Planes of foreground in rows 24 to 36 and these columns; columns below 60 are covered."""
    silhouette, planes = np.zeros(SIZE, np.uint8), new_planes(WIDTH, ROWS)
    silhouette[24:37, begin:end] = 255
    fill_planes(silhouette, silhouette.view(np.uint64), planes)
    leave_out(planes, 0, ROWS, 0, 60)
    return planes


@pytest.mark.parametrize("end", [80, 93, 94, 125])
def test_the_tip_of_a_bar_is_found(end: int) -> None:
    """Points are 3 px apart, and two pixels to either side of a point have to be foreground."""
    count, u, v = farthest_uncovered(bar(40, end), SIZE, 50.0, 30.0, 90.0)
    assert count > 0
    assert end - 6 <= u <= end - 2
    assert 24 <= v <= 36


def test_covered_foreground_and_foreground_beyond_reach_do_not_count() -> None:
    assert farthest_uncovered(bar(20, 60), SIZE, 30.0, 30.0, 90.0)[0] == 0
    count, u, v = farthest_uncovered(bar(40, 150), SIZE, 50.0, 30.0, 40.0)
    assert count > 0
    assert (u - 50.0) ** 2 + (v - 30.0) ** 2 <= 40.0**2


@pytest.mark.parametrize("u", [-500.0, 79.0, 500.0])
def test_nothing_is_found_without_foreground_or_far_from_the_image(u: float) -> None:
    assert farthest_uncovered(bar(70, 70), SIZE, u, 30.0, 90.0)[0] == 0
