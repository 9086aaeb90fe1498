"""The hierarchy: torso first, then both arms, whichever of them finishes first."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import (
    JOINT_LIMITS,
    LEFT_ARM,
    RIGHT_ARM,
    TORSO,
    reference_posture,
)
from cardbox_tracker.estimation.config import TrackerConfig, paper_preset
from cardbox_tracker.estimation.cost.compiled import CompiledSilhouette
from cardbox_tracker.estimation.cost.prior import RestPrior, RestPriorObservation
from cardbox_tracker.estimation.cost.terms import ArmCosts, SumOfTerms, TorsoCosts
from cardbox_tracker.estimation.filtering.hierarchy import HierarchicalFilter
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
BODY = BodyModel.of(hip_height_m=-0.51)
FRONT = reference_posture("front")
IMAGE_PX = 320 * 240
SEVERAL_CYCLES = TrackerConfig(
    cycles=2, noise_decay=0.5, terms=(RestPrior(0.012),), average=20, explore=0.2
)


class ConstantCost:
    """An observation that rates everything alike, and writes down what it is asked."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Any]] = []

    def torsos_beside(self, arms: np.ndarray | None) -> TorsoCosts:
        self.calls.append(("torsos_beside", arms))
        return lambda torsos: self.rate("torso", torsos)

    def arms_beside(self, torso: np.ndarray) -> ArmCosts:
        self.calls.append(("arms_beside", torso.copy()))
        return self.rate

    def postures(self, postures: np.ndarray) -> np.ndarray:
        return self.rate("postures", postures)

    def rate(self, name: str, particles: np.ndarray) -> np.ndarray:
        self.calls.append((name, particles.copy()))
        return np.zeros(len(particles))

    def names(self) -> list[str]:
        return [name for name, _ in self.calls]


class Stepped:
    """A hierarchical filter on one observation; each step returns its estimate."""

    def __init__(self, filters: HierarchicalFilter, observation: Any) -> None:
        self.filters, self.observation = filters, observation
        self.torso, self.arms = filters.torso, filters.arms

    def initialize(self, posture: np.ndarray, noise_scale: float = 1.0) -> np.ndarray:
        self.filters.initialize(self.observation, posture, noise_scale)
        return self.filters.estimate()

    def iterate(self, noise_scale: float = 1.0, explore: float = 0.0) -> np.ndarray:
        self.filters.iterate(self.observation, noise_scale, explore)
        return self.filters.estimate()


def on_constant_cost(
    config: TrackerConfig, image_px: int = IMAGE_PX
) -> tuple[Stepped, ConstantCost]:
    cost = ConstantCost()
    config = replace(config, parallel_from=None)
    filters = HierarchicalFilter(config, image_px, np.random.default_rng(0))
    return Stepped(filters, cost), cost


def before_somebody(config: TrackerConfig, seed: int, posture: np.ndarray = FRONT) -> Stepped:
    term = CompiledSilhouette(BODY, CAMERA)
    frame = term.frame(render(cardbox_patches(BODY, posture), CAMERA))
    others = (settings.build(BODY, CAMERA).observe(frame) for settings in config.terms)
    rng = np.random.default_rng(seed)
    filters = HierarchicalFilter(config, CAMERA.width * CAMERA.height, rng)
    return Stepped(filters, SumOfTerms((term.observe(frame), *others)))


@pytest.mark.parametrize("make_config", [paper_preset, lambda: SEVERAL_CYCLES])
@pytest.mark.parametrize("strategy", ["drs", "srs"])
@pytest.mark.parametrize("seed", range(3))
def test_arms_in_threads_give_what_they_give_one_after_the_other(
    make_config: Any, strategy: str, seed: int
) -> None:
    results = []
    for parallel_from in (0, None):
        config = replace(make_config(), strategy=strategy, parallel_from=parallel_from)
        filters = before_somebody(config, seed)
        postures = [filters.initialize(FRONT)]
        for cycle in range(8):
            postures.append(filters.iterate(0.6 ** (cycle % 3), 0.15 if cycle % 3 == 0 else 0.0))
        results.append(
            (
                np.array(postures),
                filters.filters.stddev(),
                filters.torso.particles,
                *(arm.particles for arm in filters.arms.values()),
            )
        )
    for parallel, sequential in zip(*results, strict=True):
        np.testing.assert_array_equal(parallel, sequential)


@pytest.mark.parametrize(
    ("particles", "parallel_from", "threads"), [(499, 500, 1), (500, 500, 2), (999, None, 1)]
)
def test_both_arms_run_at_once_where_there_is_enough_to_do(
    particles: int, parallel_from: int | None, threads: int
) -> None:
    _, cost = on_constant_cost(paper_preset())
    config = replace(paper_preset().with_particles(particles), parallel_from=parallel_from)
    filters = HierarchicalFilter(config, IMAGE_PX, np.random.default_rng(0))
    seen = set()

    def rate(side: str, arm_postures: np.ndarray) -> np.ndarray:
        seen.add(threading.get_ident())
        return np.zeros(len(arm_postures))

    cost.arms_beside = lambda torso: rate  # type: ignore[method-assign]
    filters.initialize(cost, FRONT)
    assert len(seen) == threads


def test_an_error_in_the_other_thread_is_not_lost() -> None:
    filters, cost = on_constant_cost(paper_preset())
    config = replace(paper_preset(), parallel_from=0)
    filters = HierarchicalFilter(config, IMAGE_PX, np.random.default_rng(0))

    def fail(side: str, arm_postures: np.ndarray) -> np.ndarray:
        if side == "left":
            raise RuntimeError("left arm")
        return np.zeros(len(arm_postures))

    cost.arms_beside = lambda torso: fail  # type: ignore[method-assign]
    with pytest.raises(RuntimeError, match="left arm"):
        filters.initialize(cost, FRONT)


def test_the_torso_is_fixed_before_the_arms_are_rated() -> None:
    filters, cost = on_constant_cost(paper_preset())
    first = filters.initialize(FRONT)
    assert cost.names() == ["torsos_beside", "torso", "arms_beside", "left", "right"]
    np.testing.assert_array_equal(cost.calls[0][1], FRONT)
    np.testing.assert_array_equal(cost.calls[2][1], first[TORSO])
    cost.calls.clear()
    second = filters.iterate()
    assert cost.names() == ["torsos_beside", "torso", "arms_beside", "left", "right"]
    # The arms of the estimate before stand beside the torsos of this one.
    np.testing.assert_array_equal(cost.calls[0][1], first)
    np.testing.assert_array_equal(cost.calls[2][1], second[TORSO])


def test_the_torso_alone_is_rated_where_the_settings_say_so() -> None:
    filters, cost = on_constant_cost(replace(paper_preset(), torso_beside_arms=False))
    filters.initialize(FRONT)
    filters.iterate()
    assert [arms for name, arms in cost.calls if name == "torsos_beside"] == [None, None]


def test_particles_lie_around_the_posture_within_the_joint_limits() -> None:
    posture = FRONT.copy()
    posture[LEFT_ARM] = JOINT_LIMITS[LEFT_ARM, 1]
    posture[RIGHT_ARM] = JOINT_LIMITS[RIGHT_ARM, 0]
    filters, cost = on_constant_cost(paper_preset())
    filters.initialize(posture)
    for _ in range(5):
        filters.iterate(2.0, 0.2)
    joints = {"torso": TORSO, "left": LEFT_ARM, "right": RIGHT_ARM}
    first = {name: particles for name, particles in reversed(cost.calls) if name in joints}
    for name, particles in cost.calls:
        if name in joints:
            low, high = JOINT_LIMITS[joints[name]].T
            assert np.all((particles >= low) & (particles <= high))
            np.testing.assert_array_equal(first[name][0], posture[joints[name]])


def test_each_joint_has_its_noise() -> None:
    """Over 20000 particles; without limits to cut it off, the torso's place has its own."""
    config = paper_preset().with_particles(20_000)
    middle = JOINT_LIMITS.mean(axis=1)
    filters, _ = on_constant_cost(config)
    filters.initialize(middle)
    expected = np.array([0.02, 0.1, 0.1, 0.1])
    np.testing.assert_allclose(filters.torso.particles.std(axis=0), expected, rtol=0.03)
    for arm in filters.arms.values():
        np.testing.assert_allclose(arm.particles.std(axis=0), 0.25, rtol=0.03)
    filters.initialize(middle, 0.5)
    np.testing.assert_allclose(filters.torso.particles.std(axis=0), expected / 2, rtol=0.03)


def test_every_filter_has_noise_of_its_own() -> None:
    filters, _ = on_constant_cost(paper_preset())
    filters.initialize(JOINT_LIMITS.mean(axis=1))
    left, right = (arm.particles[1:] for arm in filters.arms.values())
    assert not np.any(left == right)
    steps = [(particles - particles.mean(axis=0)).ravel() for particles in (left, right)]
    assert abs(np.corrcoef(*steps)[0, 1]) < 5 / np.sqrt(left.size)


@pytest.mark.parametrize(("explore", "explorers"), [(0.0, 0), (0.15, 30), (0.9, 180)])
def test_a_fraction_of_the_arms_explores_and_the_torso_never_does(
    explore: float, explorers: int
) -> None:
    still = replace(
        paper_preset(),
        torso=replace(paper_preset().torso, rotation_noise_rad=0.0, translation_noise_m=0.0),
        arm=replace(paper_preset().arm, rotation_noise_rad=0.0),
    )
    filters, _ = on_constant_cost(still)
    filters.initialize(FRONT)
    filters.iterate(1.0, explore)
    assert np.all(filters.torso.particles == FRONT[TORSO])
    for side, joints in (("left", LEFT_ARM), ("right", RIGHT_ARM)):
        elsewhere = np.any(filters.arms[side].particles != FRONT[joints], axis=1)
        assert np.flatnonzero(elsewhere).tolist() == list(range(200 - explorers, 200))


def test_the_estimate_is_the_best_or_the_mean_of_the_best() -> None:
    """The prior makes costs differ; an image of four times the pixels spreads them four times."""
    for average, image_px, scale in ((1, IMAGE_PX, 1.0), (20, 4 * IMAGE_PX, 4.0)):
        config = replace(paper_preset(), parallel_from=None, average=average)
        of = HierarchicalFilter(config, image_px, np.random.default_rng(0))
        filters = Stepped(of, RestPriorObservation(10.0))
        filters.initialize(FRONT)
        posture = filters.iterate()
        np.testing.assert_array_equal(posture[TORSO], filters.torso.mean(average, scale))
        np.testing.assert_array_equal(posture[LEFT_ARM], filters.arms["left"].mean(average, scale))
        is_particle = np.any(np.all(filters.torso.particles == posture[TORSO], axis=1))
        assert is_particle == (average == 1)
        stddev = of.stddev()
        np.testing.assert_array_equal(stddev[TORSO], filters.torso.stddev(posture[TORSO], scale))
        np.testing.assert_array_equal(
            stddev[RIGHT_ARM], filters.arms["right"].stddev(posture[RIGHT_ARM], scale)
        )


@pytest.mark.parametrize("strategy", ["drs", "srs"])
def test_the_seed_decides_the_estimate(strategy: str) -> None:
    def run(seed: int) -> np.ndarray:
        filters = before_somebody(replace(SEVERAL_CYCLES, strategy=strategy), seed)
        filters.initialize(FRONT)
        return filters.iterate(1.0, 0.15)

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.any(run(1) == run(2))


def test_an_arm_that_was_lost_is_found_by_exploring() -> None:
    """The arms are raised to where no noise of 0.25 rad reaches in a few cycles."""
    raised = FRONT.copy()
    raised[4] = raised[8] = np.radians(150)
    for seed in range(3):
        filters = before_somebody(SEVERAL_CYCLES, seed, raised)
        filters.initialize(FRONT, 0.1)
        for _ in range(10):
            posture = filters.iterate(0.1, 0.3)
        assert filters.observation.parts[0].overlap(posture)[1] > 0.75
