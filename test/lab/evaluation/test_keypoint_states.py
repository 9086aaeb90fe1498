"""Keypoints are counted by state and probability, right and wrong ones."""

from __future__ import annotations

import numpy as np

from lab.evaluation.figures import added, compared

TRACKED = {"tracked": [2, 0], "uncertain": [0, 0], "hidden": [0, 0], "lost": [0, 0]}


def example() -> dict[str, object]:
    off_m = np.array([[0.1, 0.31, 0.2, 0.1, 0.1, 0.5], [np.nan] * 6])
    chances = np.array([[0.0, 0.15, 0.99, 0.05, 0.15, 1.0], [0.5] * 6])
    states = np.array([["tracked", "tracked", "lost", "tracked", "uncertain", "lost"]] * 2)
    return compared(off_m, chances, states)


def test_right_and_wrong_keypoints_are_counted() -> None:
    found = example()
    assert found["shoulder"]["states"] == TRACKED
    assert found["elbow"]["states"] == TRACKED | {"tracked": [1, 1], "uncertain": [1, 0]}
    assert found["hand"]["states"]["lost"] == [2, 1]
    # The second interval, from 0.1 to 0.2, has both elbows; one of them is wrong.
    assert found["elbow"]["bins"][1] == [2, 0.3, 1]
    # A probability of 1 belongs to the last interval.
    assert found["hand"]["bins"][9] == [2, 1.99, 1]


def test_figures_of_several_runs_are_added() -> None:
    one = example()
    both = added([one, {}, one])
    assert both["elbow"]["bins"][1] == [4, 0.6, 2]
    assert both["hand"]["states"]["lost"] == [4, 2]
    assert added([{}]) == {}


def test_without_states_there_is_nothing_to_count() -> None:
    nothing = np.full((3, 6), np.nan)
    assert compared(np.zeros((3, 6)), nothing, np.full((3, 6), "")) == {}
