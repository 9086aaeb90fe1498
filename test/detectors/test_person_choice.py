"""Among several persons, the points of the one in the silhouette are chosen."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.detectors.identity import KNOWN_IMAGES
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import (
    Chosen,
    PersonChoice,
    inside,
    near_person,
    person_in,
)


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


def pixels(column: int, row: int = 50, half: int = 8) -> np.ndarray:
    image = np.zeros((100, 240), np.uint8)
    image[row - half : row + half, column - half : column + half] = 255
    return image


# Somebody comes alone, then another one; they walk past each other.
FIRST = [{1: pixels(120)}] * 20
BOTH = [{1: pixels(120 + k, half=12), 2: pixels(20 + 3 * k, 60)} for k in range(60)]


@pytest.mark.parametrize(
    ("text", "expected", "words"),
    [
        ("left", 2, "the left one, of 2 at 24.0 s"),
        ("right", 1, "the right one, of 2 at 24.0 s"),
        ("largest", 1, "the largest one, of 2 at 24.0 s"),
        ("left@75", 1, "the left one, of 2 at 75.0 s"),
        ("125,45", 1, "the one at column 125 and row 45, of 1 at 4.0 s"),
        (" 125, 60@50", 2, "the one at column 125 and row 60, of 2 at 51.0 s"),
        ("32,60", 2, "the one at column 32 and row 60, of 2 at 24.0 s"),
        ("20,98", 2, "nobody is there, so the one nearest to column 20 and row 98, of 2 at 24.0 s"),
    ],
)
def test_people_are_chosen_in_the_first_image_that_fits(
    text: str, expected: int, words: str
) -> None:
    chosen = Chosen(PersonChoice.parse(text))
    for time_s, shown in enumerate(FIRST + BOTH):
        chosen.see(float(time_s), shown)
    assert chosen.number == expected
    assert str(chosen) == f"person: {words}"


def test_an_error_of_the_detector_is_not_chosen_and_nobody_is_none() -> None:
    chosen = Chosen(PersonChoice.parse("left"))
    assert chosen.number is None
    for image in range(20):
        chosen.see(float(image), {1: pixels(120)} | ({2: pixels(20)} if image < 3 else {}))
    assert chosen.number == 1
    # A recording of less images than are needed to know anybody has a person all the same.
    few = Chosen(PersonChoice.parse("left"))
    for image in range(KNOWN_IMAGES - 1):
        few.see(float(image), {1: pixels(120), 2: pixels(20)})
    assert few.number == 2


def test_a_place_is_one_of_the_camera_s_own_image() -> None:
    choice = PersonChoice.parse("90,200@3").scaled(0.5, 0.25)
    assert choice == PersonChoice("place", (45.0, 50.0), 3.0)


@pytest.mark.parametrize(
    "text",
    ["middle", "", "1", "1,2,3", "nan,1", "1,inf", "LEFT", "left@", "left@x", "left@-3", "1,2@nan"],
)
def test_a_choice_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected left, right, largest, or X,Y"):
        PersonChoice.parse(text)
