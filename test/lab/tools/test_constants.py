"""The constants that the table lists, and their change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lab.tools.constants import changed, code_lines, compared, constants_of

SOURCE = '''"""A module."""
import numpy as np
_FAR_M, NEAR = 2.0, 3
FIRST, SECOND = 0, 1
TWICE = 2 * NEAR
HALF = 0.5 * NEAR
_GRID = np.radians([1.0, 2.0])
NAMES = ("a", "b")

@kernel
def compiled(x):
    """Multiply."""
    return x * _FAR_M

def plain(x=1.0):
    return x * NEAR
'''


def test_constants_are_numbers_that_follow_from_no_others() -> None:
    assert list(constants_of(SOURCE)) == [
        ("_FAR_M", "2.0", True),
        ("NEAR", "3", True),
        ("HALF", "0.5 * NEAR", False),
        ("_GRID", "np.radians([1.0, 2.0])", False),
    ]


def test_comments_strings_and_blanks_are_no_code() -> None:
    assert code_lines('"""Text\nmore."""\n\n# note\nA = (\n    1\n)\n') == 3


@pytest.mark.parametrize(
    ("before", "after"), [(0.75, 0.375), (0.2, 0.4), (1, 2), (30.0, 60.0), ((1.0, 4), (0.5, 8))]
)
def test_a_share_is_halved_and_another_number_doubled(before: object, after: object) -> None:
    assert changed(before) == after


def test_containers_keep_their_type() -> None:
    assert changed({"a": True, "b": [2]}) == {"a": True, "b": [4]}
    np.testing.assert_array_equal(changed(np.array([2.0, 3.0])), [4.0, 6.0])


def images(away_m: float = 0.0, hand_m: float = 0.0, sure: bool = True) -> tuple[Any, Any, Any]:
    points = np.full((1, 6, 3, 2), away_m)
    points[:, 2] += hand_m
    return np.array([away_m, hand_m, sure]), points, np.array([[True, sure]])


def test_a_change_has_the_ways_of_shape_and_place_and_the_states() -> None:
    assert compared(images(), images()) == ""
    assert compared(images(), images(away_m=0.1)) == "shape 0.0, place 17.3, state 0"
    assert compared(images(), images(hand_m=0.6, sure=False)) == "shape 17.3, place 0.0, state 50"
    assert compared(images(), "ValueError") == "ValueError"
