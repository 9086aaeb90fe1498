"""Among several persons, the points of the one in the silhouette are chosen."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import PersonChoice, inside, near_person, person_in
from cardbox_tracker.detectors.pose_network import Square


def person(column: float, score: float) -> ImagePoints:
    """Return a person whose shoulders and elbows are near a column."""
    names = ("left_shoulder", "right_shoulder", "left_elbow", "right_elbow")
    return ImagePoints.of({name: (column + 2 * i, 50.0, score) for i, name in enumerate(names)})


def silhouette(column: int) -> np.ndarray:
    image = np.zeros((100, 200), np.uint8)
    image[20:90, column - 10 : column + 20] = 255
    return image


def test_the_person_in_the_silhouette_is_chosen_though_another_is_more_certain() -> None:
    here, there = person(40.0, 0.5), person(150.0, 0.9)
    assert person_in(silhouette(40), [there, here]) is here
    assert person_in(silhouette(150), [there, here]) is there


def test_without_a_silhouette_the_most_certain_person_is_chosen() -> None:
    here, there = person(40.0, 0.5), person(150.0, 0.9)
    assert person_in(np.zeros((100, 200), np.uint8), [here, there]) is there


def test_a_person_alone_is_chosen_wherever_they_are() -> None:
    alone, nobody = person(40.0, 0.1), ImagePoints.of({})
    assert person_in(silhouette(150), [nobody, alone]) is alone
    assert person_in(silhouette(150), [nobody]) is None
    assert person_in(silhouette(150), []) is None


def test_points_outside_the_image_support_nobody() -> None:
    outside, here = person(-500.0, 0.9), person(40.0, 0.2)
    assert person_in(silhouette(40), [outside, here]) is here


def test_the_share_of_the_points_in_the_silhouette_is_known() -> None:
    near = near_person(silhouette(40))
    assert near is not None
    assert inside(near, person(40.0, 0.5)) == 1.0
    assert inside(near, person(150.0, 0.5)) == 0.0
    # Noise, or an empty silhouette, says nothing.
    noise = np.zeros((100, 200), np.uint8)
    noise[:5, :5] = 255
    assert near_person(noise) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [("left", 1), ("right", 0), ("largest", 2), ("200,50", 0), ("70,0", 2), (" 1, 1", 1)],
)
def test_people_are_chosen_by_place_and_size(text: str, expected: int) -> None:
    people = [Square(200, 50, 60, 0.0), Square(20, 60, 70, 0.0), Square(90, 50, 90, 0.0)]
    assert PersonChoice.parse(text)(people) is people[expected]


def test_a_place_is_one_of_the_camera_s_own_image() -> None:
    people = [Square(30, 50, 60, 0.0), Square(100, 60, 60, 0.0)]
    assert PersonChoice.parse("90,200").scaled(0.25, 0.25)(people) is people[0]


@pytest.mark.parametrize("text", ["middle", "", "1", "1,2,3", "nan,1", "1,inf", "LEFT"])
def test_a_choice_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected left, right, largest, or X,Y"):
        PersonChoice.parse(text)
