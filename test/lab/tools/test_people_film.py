"""The picture from the side has depth to the right and height upwards."""

from __future__ import annotations

import numpy as np

from lab.tools.people_film import from_the_side
from lab.tools.people_sheet import REFERENCE_BGR


def test_depth_grows_to_the_right_and_height_upwards() -> None:
    # All keypoints at one point: 0.5 m farther than the middle, and 0.2 m higher.
    keypoints_m = np.tile([0.3, -0.2, 2.5], (6, 1))
    picture = from_the_side({"reference": keypoints_m}, np.array([0.0, 0.0, 2.0]), 240)
    drawn = (picture[60:] == REFERENCE_BGR).all(axis=2)
    rows, columns = np.nonzero(drawn)
    assert abs(columns.mean() - (120 + 85)) <= 1.0
    assert abs(60 + rows.mean() - (120 - 34)) <= 1.0


def test_keypoints_without_a_reference_are_left_out() -> None:
    nothing = from_the_side({}, np.zeros(3), 100)
    unknown = from_the_side({"reference": np.full((6, 3), np.nan)}, np.zeros(3), 100)
    assert np.array_equal(nothing, unknown)
