"""The figure of a person: its size and pixels, and whether two are one person."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.detectors.figure import Figure

SHAPE = (200, 160)
STANDING = {
    "nose": (80.0, 30.0),
    "left_shoulder": (95.0, 50.0),
    "right_shoulder": (65.0, 50.0),
    "left_elbow": (105.0, 75.0),
    "right_elbow": (55.0, 75.0),
    "left_wrist": (110.0, 100.0),
    "right_wrist": (50.0, 100.0),
    "left_hip": (88.0, 100.0),
    "right_hip": (72.0, 100.0),
}


def figure(aside_px: float = 0.0, without: str = "-", **moved: tuple[float, float]) -> Figure:
    joints = (STANDING | moved).items()
    return Figure(
        {
            name: np.array(at) + np.array([aside_px, 0.0])
            for name, at in joints
            if without not in name
        }
    )


def test_the_trunk_gives_size_and_place() -> None:
    found = figure()
    assert found.trunk_px == pytest.approx(50.0)
    np.testing.assert_allclose(found.middle_px, [80.0, 75.0])


def test_hips_outside_of_the_image_are_below_the_shoulders() -> None:
    np.testing.assert_allclose(figure(without="hip").middle_px, [80.0, 71.0])


def test_without_shoulders_there_is_no_size() -> None:
    assert np.isnan(figure(without="shoulder").trunk_px)


def test_people_are_apart_in_lengths_of_the_trunk() -> None:
    assert figure().apart(figure(25.0)) == pytest.approx(0.5)


def test_left_and_right_exchanged_is_the_same_person() -> None:
    exchanged = {
        name: STANDING[
            name.replace("left", "right") if "left" in name else name.replace("right", "left")
        ]
        for name in STANDING
    }
    assert figure().apart(figure(**exchanged)) == pytest.approx(0.0)


def test_pixels_are_those_of_limbs_trunk_and_legs() -> None:
    drawn = figure().drawn(SHAPE)
    inside = [(80, 30), (80, 75), (110, 98), (52, 90), (88, 150)]
    assert all(drawn[row, column] == 255 for column, row in inside)
    assert not drawn[:10].any() and not drawn[:, :35].any() and not drawn[:, 125:].any()


def test_known_knees_are_where_the_legs_are() -> None:
    bent = figure(left_knee=(120.0, 105.0), left_ankle=(121.0, 140.0)).drawn(SHAPE)
    assert bent[103, 112] == 255 and bent[150, 95] == 0


def test_the_trunk_lies_between_shoulders_and_hips() -> None:
    trunk = figure().trunk(SHAPE)
    rows, columns = np.nonzero(trunk)
    assert (rows.min() > 50, rows.max() < 100, columns.min() > 65, columns.max() < 95) == (
        True,
    ) * 4
    assert not figure(without="hip").trunk(SHAPE).any()
