"""One particle filter: the kept particle, the noise, the limits, and its statistics by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.search import particle_filter
from cardbox_tracker.search.config import FilterConfig
from cardbox_tracker.search.particle_filter import ParticleFilter

NOISE = np.array([0.25, 0.02, 0.1])
WIDE = np.array([[-100.0, 100.0]] * 3)
START = np.array([0.5, -0.2, 0.1])
SEEDS = st.integers(0, 2**32 - 1)


def distance_px(particles: np.ndarray) -> np.ndarray:
    return 1000.0 * np.linalg.norm(particles - (1.0, 0.0, -0.5), axis=1)


def make(
    seed: int = 0,
    strategy: str = "drs",
    limits: np.ndarray = WIDE,
    noise: np.ndarray = NOISE,
    **values: Any,
) -> ParticleFilter:
    config = FilterConfig(**{"particles": 50, **values})
    return ParticleFilter(config, strategy, noise, limits, np.random.default_rng(seed))


def with_particles(particles: np.ndarray, costs: np.ndarray, **values: Any) -> ParticleFilter:
    """A filter whose particles and costs are given, one joint each."""
    made = make(noise=np.ones(1), limits=WIDE[:1], particles=len(particles), **values)
    made.particles = np.array(particles, dtype=float)[:, None]
    made.costs = np.array(costs, dtype=float)
    return made


@pytest.mark.parametrize("strategy", ["drs", "srs"])
@given(seed=SEEDS)
def test_the_first_particle_is_the_best_before_unchanged(strategy: str, seed: int) -> None:
    filters = make(seed, strategy)
    filters.initialize(START, distance_px)
    np.testing.assert_array_equal(filters.particles[0], START)
    for _ in range(4):
        best = filters.best().copy()
        filters.iterate(distance_px)
        np.testing.assert_array_equal(filters.particles[0], best)
        # All others moved.
        assert not np.any(np.all(filters.particles[1:] == best, axis=1))


@pytest.mark.parametrize("strategy", ["drs", "srs"])
@given(seed=SEEDS)
def test_the_lowest_cost_never_rises_on_one_silhouette(strategy: str, seed: int) -> None:
    filters = make(seed, strategy)
    filters.initialize(START, distance_px)
    lowest = filters.costs.min()
    for _ in range(6):
        filters.iterate(distance_px)
        assert filters.costs.min() <= lowest
        lowest = filters.costs.min()


@given(seed=SEEDS, noise=st.floats(0.0, 20.0))
def test_no_particle_leaves_the_limits(seed: int, noise: float) -> None:
    limits = np.array([[-0.3, 0.5], [0.0, 0.1], [-2.0, -1.0]])
    filters = make(seed, limits=limits, noise=np.full(3, noise))
    rated: list[np.ndarray] = []

    def rate(particles: np.ndarray) -> np.ndarray:
        rated.append(particles.copy())
        return distance_px(particles)

    # Even a start outside is moved onto them.
    filters.initialize(np.array([9.0, 0.05, -9.0]), rate)
    filters.iterate(rate)
    filters.iterate(rate, noise_scale=3.0)
    for particles in rated:
        assert np.all((particles >= limits[:, 0]) & (particles <= limits[:, 1]))


def test_costs_are_those_of_the_particles() -> None:
    filters = make()
    filters.initialize(START, distance_px)
    np.testing.assert_array_equal(filters.costs, distance_px(filters.particles))
    filters.iterate(distance_px)
    np.testing.assert_array_equal(filters.costs, distance_px(filters.particles))


@pytest.mark.parametrize("noise_scale", [1.0, 0.6, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_noise_has_the_standard_deviation_it_should(seed: int, noise_scale: float) -> None:
    """Bounds of five standard errors of 20000 draws."""
    count = 20_000
    filters = make(seed, particles=count, survival_rate=1e-9)
    expected = NOISE * noise_scale
    filters.initialize(START, distance_px, noise_scale)
    best = START
    for _ in range(2):
        # One survivor, so that all were drawn around it.
        steps = (filters.particles - best)[1:]
        np.testing.assert_allclose(steps.std(axis=0), expected, rtol=5 / np.sqrt(2 * count))
        np.testing.assert_array_less(np.abs(steps.mean(axis=0)), 5 * expected / np.sqrt(count))
        # Independent of each other, and Gaussian: 68.3 % lie within one standard deviation.
        correlation = np.corrcoef(steps.T) - np.eye(3)
        assert np.abs(correlation).max() < 5 / np.sqrt(count)
        within = np.mean(np.abs(steps) < expected, axis=0)
        np.testing.assert_allclose(within, 0.6827, atol=5 * np.sqrt(0.22 / count))
        best = filters.best().copy()
        filters.iterate(distance_px, noise_scale)


def test_a_joint_without_noise_stays() -> None:
    filters = make(noise=np.array([0.2, 0.0, 0.2]))
    filters.initialize(START, distance_px)
    filters.iterate(distance_px)
    np.testing.assert_array_equal(filters.particles[:, 1], START[1])


def test_drs_draws_the_others_around_the_survivors() -> None:
    costs = [5.0, 1.0, 4.0, 2.0, 3.0]
    filters = with_particles(np.array([50.0, 10, 40, 20, 30]), np.array(costs), survival_rate=0.4)
    filters.noise = np.array([1e-3])
    filters.iterate(lambda particles: particles[:, 0])
    # The best, the other of int(0.4 * 5) survivors, and the best for those that died.
    np.testing.assert_allclose(filters.particles[:, 0], [10, 20, 10, 10, 10], atol=0.01)


def test_resampling_is_given_the_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    given_to = []

    def resample(strategy: str, costs: np.ndarray, *rest: Any) -> np.ndarray:
        given_to.append((strategy, costs.tolist(), *rest))
        return np.array([1, 1, 0])

    monkeypatch.setattr(particle_filter, "resample", resample)
    rng = np.random.default_rng(0)
    config = FilterConfig(3, 0.7, sigma_gamma_px=500.0)
    filters = ParticleFilter(config, "systematic", np.zeros(1), WIDE[:1], rng)
    filters.particles = np.array([[1.0], [2.0], [3.0]])
    filters.costs = np.array([30.0, 10.0, 20.0])
    filters.iterate(lambda particles: particles[:, 0], sigma_scale=4.0)
    assert given_to == [("systematic", [30.0, 10.0, 20.0], 0.7, 2000.0, rng, True)]
    assert filters.particles.tolist() == [[2.0], [2.0], [1.0]]


def test_the_best_by_hand() -> None:
    filters = with_particles(np.array([7.0, 8, 9]), np.array([30.0, 10, 20]))
    assert filters.best().tolist() == [8.0]
    assert filters.mean(1).tolist() == [8.0]


@pytest.mark.parametrize("spread_scale", [1.0, 4.0])
@pytest.mark.parametrize(
    ("count", "expected"),
    [
        # Weights 1, 1/2, 1/4 for each factor of exp(-1) ** ln 2 that the cost is above the best.
        (1, 6.0),
        (2, (6.0 + 3.0 / 2) / 1.5),
        (3, (6.0 + 3.0 / 2 + 9.0 / 4) / 1.75),
        (4, (6.0 + 3.0 / 2 + 9.0 / 4) / 1.75),
    ],
)
def test_the_mean_by_hand(count: int, expected: float, spread_scale: float) -> None:
    half = 60.0 * spread_scale * np.log(2.0)
    costs = 500.0 + np.array([2 * half, 0.0, 1e6, half])
    filters = with_particles(np.array([9.0, 6, -1e3, 3]), costs)
    assert filters.mean(count, spread_scale)[0] == pytest.approx(expected)


def test_the_standard_deviation_by_hand() -> None:
    half = 60.0 * np.log(2.0)
    costs = 500.0 + np.array([1e6, half, 0.0, 1e6])
    filters = with_particles(np.array([99.0, 1, 0, -99]), costs)
    # Those at 0 and 1 weigh 2/3 and 1/3: variance 2/9 around their mean of 1/3.
    mean = filters.mean(2)
    assert mean[0] == pytest.approx(1 / 3)
    assert filters.stddev(mean)[0] == pytest.approx(np.sqrt(2 / 9))
    # Around another point it is larger by the square of the way there.
    assert filters.stddev(mean + 1.0)[0] == pytest.approx(np.sqrt(2 / 9 + 1))
    assert filters.particles[:, 0].tolist() == [99, 1, 0, -99]


def test_a_larger_image_spreads_the_weights_of_the_standard_deviation() -> None:
    half = 4.0 * 60.0 * np.log(2.0)
    filters = with_particles(np.array([0.0, 1, 4]), 500.0 + np.array([0.0, half, 2 * half]))
    # Weights 4/7, 2/7 and 1/7 around 0.
    assert filters.stddev(np.zeros(1), 4.0)[0] == pytest.approx(np.sqrt(2 / 7 + 16 / 7))


@pytest.mark.parametrize("count", [2, 50])
def test_statistics_leave_the_particles_alone(count: int) -> None:
    filters = make(survival_rate=count / 50)
    filters.initialize(START, distance_px)
    before = filters.particles.copy()
    filters.stddev(filters.mean(count))
    np.testing.assert_array_equal(filters.particles, before)


@pytest.mark.parametrize("strategy", ["drs", "srs"])
def test_the_seed_decides_everything(strategy: str) -> None:
    def run(seed: int) -> np.ndarray:
        filters = make(seed, strategy)
        filters.initialize(START, distance_px)
        for _ in range(3):
            filters.iterate(distance_px)
        return filters.particles

    np.testing.assert_array_equal(run(3), run(3))
    assert not np.any(run(3) == run(4))


def test_the_filter_finds_the_minimum() -> None:
    """From half a radian away, over five seeds."""
    for seed in range(5):
        filters = make(seed, particles=200, survival_rate=0.4)
        filters.initialize(np.array([0.6, 0.1, -0.3]), distance_px)
        for cycle in range(25):
            filters.iterate(distance_px, noise_scale=0.85**cycle)
        np.testing.assert_allclose(filters.mean(20), (1.0, 0.0, -0.5), atol=0.02)
