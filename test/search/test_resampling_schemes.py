"""Standard schemes and the elite particle: what each promises about its ancestors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cardbox_tracker.search.config import FilterConfig
from cardbox_tracker.search.particle_filter import ParticleFilter
from cardbox_tracker.search.resampling import SCHEMES, STRATEGIES, gaussian_weights, resample

SIGMA_PX = 1000.0

costs_of = st.lists(st.integers(0, 5000), min_size=2, max_size=60).map(
    lambda values: np.array(values, dtype=np.float64)
)
seeds = st.integers(0, 2**32 - 1)


def ancestors(
    name: str, costs: NDArray[np.float64], elite: bool, seed: int = 0
) -> NDArray[np.intp]:
    return resample(name, costs, 0.4, SIGMA_PX, np.random.default_rng(seed), elite)


@pytest.mark.parametrize("elite", [True, False])
@pytest.mark.parametrize("name", STRATEGIES)
@given(costs=costs_of, seed=seeds)
def test_there_are_n_ancestors_among_the_particles(
    name: str, elite: bool, costs: NDArray[np.float64], seed: int
) -> None:
    chosen = ancestors(name, costs, elite, seed)
    assert chosen.shape == costs.shape
    assert np.all((chosen >= 0) & (chosen < len(costs)))
    if elite:
        assert costs[chosen[0]] == costs.min()


@pytest.mark.parametrize("name", ["srs", "systematic"])
@given(costs=costs_of, seed=seeds)
def test_one_draw_a_stratum_keeps_copies_within_one_of_the_expected(
    name: str, costs: NDArray[np.float64], seed: int
) -> None:
    """Systematic: floor or ceiling of n w. Stratified may be one further off, at either end."""
    expected = len(costs) * gaussian_weights(costs, SIGMA_PX)
    copies = np.bincount(ancestors(name, costs, False, seed), minlength=len(costs))
    slack = 1 if name == "systematic" else 2
    assert np.all(np.abs(copies - expected) < slack + 1e-6)


@pytest.mark.parametrize("name", SCHEMES)
@given(costs=costs_of, seed=seeds, n=st.integers(1, 90))
def test_a_scheme_draws_as_many_as_it_is_asked_for(
    name: str, costs: NDArray[np.float64], seed: int, n: int
) -> None:
    weights = gaussian_weights(costs, SIGMA_PX)
    drawn = SCHEMES[name](weights, n, np.random.default_rng(seed))
    assert drawn.shape == (n,)
    assert np.all(weights[drawn] > 0)


@given(costs=costs_of, seed=seeds, n=st.integers(1, 90))
def test_residual_copies_each_particle_at_least_as_often_as_its_whole_share(
    costs: NDArray[np.float64], seed: int, n: int
) -> None:
    weights = gaussian_weights(costs, SIGMA_PX)
    drawn = SCHEMES["residual"](weights, n, np.random.default_rng(seed))
    assert np.all(np.bincount(drawn, minlength=len(costs)) >= np.floor(n * weights))


@given(costs=costs_of, seed=seeds)
def test_the_elite_takes_the_place_of_the_first_one_drawn(
    costs: NDArray[np.float64], seed: int
) -> None:
    for name in SCHEMES:
        with_elite, without = (ancestors(name, costs, elite, seed) for elite in (True, False))
        assert with_elite[0] == np.argmin(costs)
        np.testing.assert_array_equal(with_elite[1:], without[1:])


@pytest.mark.parametrize("name", SCHEMES)
def test_copies_are_in_proportion_to_the_weights_on_average(name: str) -> None:
    costs = np.array([0.0, 800.0, 1200.0, 1600.0, 2500.0])
    draws = 4000
    copies = np.zeros(len(costs))
    rng = np.random.default_rng(3)
    for _ in range(draws):
        chosen = SCHEMES[name](gaussian_weights(costs, SIGMA_PX), len(costs), rng)
        copies += np.bincount(chosen, minlength=len(costs))
    shares = copies / copies.sum()
    # Five standard deviations of the scheme with the highest variance.
    margin = 5 * np.sqrt(0.25 / (draws * len(costs)))
    np.testing.assert_allclose(shares, gaussian_weights(costs, SIGMA_PX), atol=margin)


@pytest.mark.parametrize("name", SCHEMES)
def test_a_particle_with_all_the_weight_is_the_only_ancestor(name: str) -> None:
    costs = np.array([9e4, 9e4, 0.0, 9e4])
    for elite in (True, False):
        assert np.all(ancestors(name, costs, elite) == 2)


def test_systematic_resampling_takes_a_single_random_number() -> None:
    rng, counted = np.random.default_rng(5), np.random.default_rng(5)
    SCHEMES["systematic"](np.full(10, 0.1), 10, rng)
    counted.random()
    assert rng.random() == counted.random()


@pytest.mark.parametrize("name", STRATEGIES)
def test_only_an_elite_particle_goes_unchanged_into_the_next_cycle(name: str) -> None:
    for elite in (True, False):
        particle_filter = ParticleFilter(
            FilterConfig(particles=30, elite=elite),
            name,
            np.full(2, 0.1),
            np.array([[-9.0, 9.0], [-9.0, 9.0]]),
            np.random.default_rng(0),
        )
        particle_filter.initialize(np.zeros(2), lambda p: 1000 * np.abs(p).sum(axis=1))
        best = particle_filter.best().copy()
        particle_filter.iterate(lambda p: 1000 * np.abs(p).sum(axis=1))
        kept = np.any(np.all(particle_filter.particles == best, axis=1))
        assert kept == elite
