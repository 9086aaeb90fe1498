"""Among several persons, the points of the one in the silhouette are chosen."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import person_in


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
