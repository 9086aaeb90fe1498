"""DRS and SRS, the two strategies of the paper, against what their algorithms give by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.search.resampling import gaussian_weights, resample, truncation

SIGMA_PX = 1000.0

COSTS = st.lists(st.integers(0, 100_000), min_size=2, max_size=80).map(
    lambda values: np.array(values, dtype=np.float64)
)
RATES = st.floats(1e-9, 1.0)
SEEDS = st.integers(0, 2**32 - 1)


class Places:
    """Stands for a generator whose uniform numbers are known."""

    def __init__(self, *places: float) -> None:
        self.places = places

    def random(self, count: int) -> np.ndarray:
        assert count == len(self.places)
        return np.array(self.places)


def drs(costs: np.ndarray, survival_rate: float) -> np.ndarray:
    # Neither sigma_gamma nor a generator is used.
    ancestors = resample("drs", costs, survival_rate, float("nan"), None)
    np.testing.assert_array_equal(ancestors, truncation(costs, survival_rate))
    return ancestors


def srs(costs: np.ndarray, rng: object, sigma_px: float = SIGMA_PX) -> np.ndarray:
    return resample("srs", costs, float("nan"), sigma_px, rng)


def costs_with_weights(*weights: float) -> np.ndarray:
    """Costs of which equation (weights of SRS) makes those weights, the largest at cost 0."""
    relative = np.array(weights) / max(weights)
    return SIGMA_PX * np.sqrt(-2.0 * np.log(relative))


@pytest.mark.parametrize(
    ("survival_rate", "others"),
    [
        (0.1, []),
        (0.19, []),
        (0.2, [3]),
        (0.4, [2, 3, 4]),
        (0.49, [2, 3, 4]),
        (0.9, [0, 2, 3, 4, 6, 7, 8, 5]),
        (1.0, [0, 2, 3, 4, 6, 7, 8, 5, 9]),
        (1e-9, []),
    ],
)
def test_drs_by_hand(survival_rate: float, others: list[int]) -> None:
    costs = np.array([50.0, 10, 40, 20, 30, 90, 80, 70, 60, 100])
    ancestors = drs(costs, survival_rate)
    # The best first, int(e N) - 1 more, then the best again for all that died.
    assert ancestors[0] == 1
    assert sorted(ancestors[1 : 1 + len(others)]) == sorted(others)
    assert ancestors[1 + len(others) :].tolist() == [1] * (9 - len(others))


@pytest.mark.parametrize(
    ("costs", "survival_rate", "expected"),
    [([2, 1], 0.5, [1, 1]), ([2, 1], 1.0, [1, 0]), ([1, 2], 1.0, [0, 1]), ([1, 2], 0.1, [0, 0])],
)
def test_drs_of_two_by_hand(costs: list[float], survival_rate: float, expected: list[int]) -> None:
    assert drs(np.array(costs, dtype=float), survival_rate).tolist() == expected


def test_drs_ranks_costs_that_are_too_large_for_weights() -> None:
    costs = np.array([1e300, 1e299, 1e301, 2e299])
    assert sorted(drs(costs, 0.5).tolist()) == [1, 1, 1, 3]


@given(COSTS, RATES)
def test_drs_survivors_are_the_best_and_each_survives_once(
    costs: np.ndarray, survival_rate: float
) -> None:
    ancestors = drs(costs, survival_rate)
    count = max(1, int(survival_rate * len(costs) + 1e-9))
    survivors = np.unique(ancestors)
    assert ancestors.shape == costs.shape
    assert np.all((ancestors >= 0) & (ancestors < len(costs)))
    assert costs[ancestors[0]] == costs.min()
    assert len(survivors) == count
    # Where costs are equal any of them may be among the best.
    np.testing.assert_array_equal(np.sort(costs[survivors]), np.sort(costs)[:count])
    copies = np.bincount(ancestors, minlength=len(costs))
    copies[ancestors[0]] -= len(costs) - count
    np.testing.assert_array_equal(copies[survivors], 1)


@given(COSTS, RATES)
def test_drs_looks_at_the_order_alone(costs: np.ndarray, survival_rate: float) -> None:
    expected = drs(costs, survival_rate)
    for changed in (1e-6 * costs, costs**3 + 7.0, np.log1p(costs), 1e12 + costs):
        np.testing.assert_array_equal(drs(changed, survival_rate), expected)


@given(st.integers(2, 80), RATES)
def test_drs_of_equal_costs_keeps_as_many(count: int, survival_rate: float) -> None:
    ancestors = drs(np.full(count, 123.0), survival_rate)
    copies = np.bincount(ancestors, minlength=count)
    survivors = max(1, int(survival_rate * count + 1e-9))
    assert np.count_nonzero(copies) == survivors
    assert copies[ancestors[0]] == copies.max() == count - survivors + 1


def test_of_equal_costs_the_first_survive() -> None:
    ancestors = drs(np.array([5.0, 7.0, 3.0, 7.0, 3.0, 7.0]), 4 / 6)
    assert list(ancestors) == [2, 0, 1, 4, 2, 2]


def test_drs_leaves_the_costs_as_they_are() -> None:
    costs = np.array([3.0, 1.0, 2.0, 0.0])
    drs(costs, 0.5)
    assert costs.tolist() == [3, 1, 2, 0]


def test_gaussian_weights_by_hand() -> None:
    # exp(-W^2 / (2 sigma^2)) at 0, sigma and 2 sigma.
    raw = np.array([1.0, np.exp(-0.5), np.exp(-2.0)])
    np.testing.assert_allclose(
        gaussian_weights(np.array([0.0, SIGMA_PX, 2 * SIGMA_PX]), SIGMA_PX), raw / raw.sum()
    )


@given(COSTS, st.floats(100.0, 1e6))
def test_gaussian_weights_are_a_distribution_that_falls_with_the_cost(
    costs: np.ndarray, sigma_px: float
) -> None:
    weights = gaussian_weights(costs, sigma_px)
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(weights >= 0)
    assert np.all(np.diff(weights[np.argsort(costs)]) <= 1e-15)


@pytest.mark.parametrize("offset_px", [1e6, 1e9, 1e12])
def test_huge_costs_leave_weights(offset_px: float) -> None:
    """exp(-W^2 / 2 sigma^2) alone would be 0 for all of them."""
    weights = gaussian_weights(offset_px + np.array([0.0, 0.0, offset_px]), SIGMA_PX)
    np.testing.assert_allclose(weights, [0.5, 0.5, 0.0])


@given(st.integers(2, 80), st.floats(0.0, 1e9))
def test_equal_costs_weigh_the_same(count: int, cost_px: float) -> None:
    np.testing.assert_allclose(gaussian_weights(np.full(count, cost_px), SIGMA_PX), 1.0 / count)


@pytest.mark.parametrize(
    ("places", "drawn"),
    [
        # One number in each of four strata, against the cumulative weights 0.1, 0.3, 0.6, 1.
        ((0.5, 0.5, 0.5, 0.5), [2, 3, 3]),  # 0.375, 0.625, 0.875
        ((0.5, 0.1, 0.1, 0.9), [1, 2, 3]),  # 0.275, 0.525, 0.975
        ((0.9, 0.3, 0.5, 0.0), [2, 3, 3]),  # 0.325, 0.625, 0.75
        ((0.0, 0.0, 0.0, 0.0), [1, 2, 3]),  # 0.25, 0.5, 0.75
    ],
)
def test_srs_by_hand(places: tuple[float, ...], drawn: list[int]) -> None:
    costs = costs_with_weights(0.1, 0.2, 0.3, 0.4)
    np.testing.assert_allclose(gaussian_weights(costs, SIGMA_PX), [0.1, 0.2, 0.3, 0.4])
    # The first is the best, whatever its stratum says.
    assert srs(costs, Places(*places)).tolist() == [3, *drawn]


def test_srs_of_two_by_hand() -> None:
    costs = costs_with_weights(0.7, 0.3)
    assert srs(costs, Places(0.0, 0.3)).tolist() == [0, 0]  # 0.65
    assert srs(costs, Places(0.0, 0.5)).tolist() == [0, 1]  # 0.75


@given(st.integers(2, 80), SEEDS)
def test_srs_of_equal_costs_keeps_every_particle_but_for_the_elite(count: int, seed: int) -> None:
    """Each has the weight of one stratum: number i falls into the share of particle i."""
    ancestors = srs(np.full(count, 5.0), np.random.default_rng(seed))
    assert ancestors[0] == 0
    np.testing.assert_array_equal(ancestors[1:], np.arange(1, count))


@given(COSTS, SEEDS)
def test_srs_ancestors_are_ordered_and_have_weight(costs: np.ndarray, seed: int) -> None:
    ancestors = srs(costs, np.random.default_rng(seed))
    assert ancestors.shape == costs.shape
    assert costs[ancestors[0]] == costs.min()
    assert np.all(np.diff(ancestors[1:]) >= 0)
    assert np.all(gaussian_weights(costs, SIGMA_PX)[ancestors] > 0)


@given(COSTS, SEEDS)
def test_srs_draws_by_its_generator_alone(costs: np.ndarray, seed: int) -> None:
    first, second = (srs(costs, np.random.default_rng(seed)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_srs_does_not_look_at_the_order_alone() -> None:
    """What tells it from DRS: costs that lie closer together share the weights more evenly."""
    costs = np.linspace(0.0, 3000.0, 50)
    far = srs(costs, np.random.default_rng(0))
    near = srs(costs / 10.0, np.random.default_rng(0))
    assert len(np.unique(far)) < len(np.unique(near))


def test_survivors_are_not_lost_to_rounding() -> None:
    """0.29 times 100 is 28.999999999999996."""
    costs = np.arange(100, dtype=np.float64)
    ancestors = truncation(costs, 0.29)
    assert sorted(set(ancestors.tolist())) == list(range(29))
