"""Networks that disagree correct less."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.estimation.filtering.correction import limited

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return answers and spreads (2, 9), m."""
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 0.1, (2, 9)), rng.uniform(0.0, 0.2, (2, 9))


def test_each_joint_is_shortened_by_its_own_spread() -> None:
    answers, spread = np.zeros((2, 9)), np.zeros((2, 9))
    # Squares of the left elbow: 0.09 + 0.16 = 0.25, and its spread's: 0.75.
    answers[0, 3:6] = 0.3, 0.0, 0.4
    spread[0, 3:6] = np.sqrt(0.25)
    answers[0, 6:], answers[1, :3] = 0.1, 0.2
    expected = answers.copy()
    expected[0, 3:6] = 0.075, 0.0, 0.1
    assert limited(answers, spread, 1.0) == pytest.approx(expected)
    # A third of the spread's weight gives 0.25 / (0.25 + 0.25).
    expected[0, 3:6] = 0.15, 0.0, 0.2
    assert limited(answers, spread, 1 / 3) == pytest.approx(expected)


@given(SEEDS)
def test_agreeing_networks_keep_their_answers(seed: int) -> None:
    answers, spread = drawn(seed)
    assert limited(answers, np.zeros((2, 9))) == pytest.approx(answers, abs=1e-6)
    # Without doubt the spread does not matter.
    assert limited(answers, spread, 0.0) == pytest.approx(answers, abs=1e-6)


@given(SEEDS)
def test_answers_that_disagree_vanish(seed: int) -> None:
    answers, spread = drawn(seed)
    assert np.abs(limited(answers, 1000.0 * (spread + 0.001))).max() < 0.01 * np.abs(answers).max()
    assert not limited(np.zeros((2, 9)), spread).any()


@given(SEEDS, st.floats(0.0, 10.0))
def test_directions_remain_and_nothing_grows(seed: int, doubt: float) -> None:
    answers, spread = drawn(seed)
    before = answers.reshape(6, 3)
    after = limited(answers, spread, doubt).reshape(6, 3)
    lengths, shortened = (np.linalg.norm(one, axis=1) for one in (before, after))
    assert (shortened <= lengths + 1e-12).all()
    # The cosine between the two is 1.
    assert np.sum(before * after, axis=1) == pytest.approx(lengths * shortened)
    more = np.linalg.norm(limited(answers, spread, doubt + 1.0).reshape(6, 3), axis=1)
    assert (more <= shortened + 1e-12).all()


def test_nothing_answered_by_networks_that_agree_is_finite() -> None:
    assert limited(np.zeros((2, 9)), np.zeros((2, 9)), 0.0).tolist() == [[0.0] * 9] * 2
