"""Several people in image after image, with networks whose answers are given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.detectors import people_network
from cardbox_tracker.detectors.people_network import PeopleNetwork
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection, Square

IMAGE = np.zeros((120, 200, 3), np.uint8)
STEP_NS = 50_000_000
JOINTS = {
    **{f"{side}_shoulder": (sign * 8.0, -25.0) for side, sign in (("left", 1), ("right", -1))},
    **{f"{side}_hip": (sign * 5.0, 0.0) for side, sign in (("left", 1), ("right", -1))},
}


def detection(column: float) -> Detection:
    """A person whose hips are at a column, in the middle row."""
    points = np.tile([column, 60.0], (len(LANDMARKS), 1))
    for name, offset in JOINTS.items():
        points[LANDMARKS.index(name)] += offset
    return Detection(points, np.ones(len(LANDMARKS)), np.zeros(IMAGE.shape[:2], np.uint8))


class Network:
    """People at given columns; a square shows the nearest one whose hips are not hidden."""

    def __init__(self, *columns: float) -> None:
        self.people, self.searched = list(columns), 0

    def detected(self, image: np.ndarray, view: Square) -> list[Square]:
        self.searched += 1
        return [Square(column, 60.0, 80.0, 0.0) for column in self.people]

    def located(self, image: np.ndarray, square: Square, others: np.ndarray | None = None) -> Any:
        seen = [c for c in self.people if others is None or not others[60, int(c)]]
        near = [column for column in seen if abs(column - square.u) < 40.0]
        if not near:
            return None
        column = min(near, key=lambda one: abs(one - square.u))
        return detection(column), Square(column, 60.0, 80.0, 0.0)


def columns(found: list[Detection]) -> list[float]:
    return [float(one.points_px[LANDMARKS.index("left_hip"), 0] - 5.0) for one in found]


def make(network: Network, most: int = 2) -> PeopleNetwork:
    return PeopleNetwork(network, most)  # type: ignore[arg-type]


def test_each_person_is_followed_in_the_own_square() -> None:
    network = Network(40.0, 150.0)
    people = make(network)
    assert columns(people(IMAGE, 0)) == [40.0, 150.0]
    searched = network.searched
    network.people = [45.0, 145.0]
    assert columns(people(IMAGE, STEP_NS)) == [45.0, 145.0]
    assert network.searched == searched


def test_no_more_people_are_found_than_are_asked_for() -> None:
    assert len(make(Network(20.0, 90.0, 160.0))(IMAGE, 0)) == 2


def test_who_comes_later_is_found_by_the_next_search() -> None:
    network = Network(40.0)
    people = make(network)
    people(IMAGE, 0)
    network.people.append(150.0)
    assert columns(people(IMAGE, STEP_NS)) == [40.0]
    assert columns(people(IMAGE, people_network._SEARCH_NS)) == [40.0, 150.0]


def test_two_squares_on_one_person_are_one_person() -> None:
    network = Network(80.0, 105.0)
    people = make(network)
    people(IMAGE, 0)
    # One of them leaves; the square of that one shows the other.
    network.people = [82.0]
    assert columns(people(IMAGE, STEP_NS)) == [82.0]


def test_somebody_who_was_hidden_for_a_moment_is_sought_in_the_last_square() -> None:
    network = Network(40.0, 150.0)
    people = make(network)
    people(IMAGE, 0)
    network.people = [40.0]
    people(IMAGE, STEP_NS)
    network.people = [40.0, 155.0]
    assert columns(people(IMAGE, 2 * STEP_NS)) == [40.0, 155.0]


def test_after_a_new_start_nothing_is_known() -> None:
    network = Network(40.0)
    people = make(network)
    people(IMAGE, 0)
    network.people = [150.0]
    people.forget()
    assert columns(people(IMAGE, STEP_NS)) == [150.0]


@pytest.mark.parametrize("shape", [(240, 320), (320, 240), (200, 200)])
def test_the_parts_of_the_first_search_cover_the_image(shape: tuple[int, int]) -> None:
    seen = np.zeros(shape, bool)
    views = list(make(Network())._views((*shape, 3)))
    for view in views[1:]:
        half = view.side / 2
        rows = slice(max(round(view.v - half), 0), round(view.v + half))
        seen[rows, max(round(view.u - half), 0) : round(view.u + half)] = True
    assert seen.all() and views[0].side == max(shape)
