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
    JOINT_NAMES,
    LEFT_ARM,
    RIGHT_ARM,
    TORSO,
    reference_posture,
)
from cardbox_tracker.estimation.config import TrackerConfig, default_preset, paper_preset
from cardbox_tracker.estimation.cost.compiled import CompiledCost
from cardbox_tracker.estimation.filtering.hierarchy import HierarchicalFilter
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
BODY = BodyModel.of(hip_height_m=-0.51)
FRONT = reference_posture("front")
IMAGE_PX = 320 * 240


class ConstantCost:
    """Rates everything alike, and writes down what it is asked."""

    rows = 72
    silhouette_px = 1000

    def __init__(self) -> None:
        self.calls: list[tuple[str, Any]] = []

    def fix_arms(self, posture: np.ndarray | None) -> None:
        self.calls.append(("fix_arms", posture))

    def torso(self, torso_postures: np.ndarray) -> np.ndarray:
        self.calls.append(("torso", torso_postures.copy()))
        return np.zeros(len(torso_postures), np.int64)

    def fix_torso(self, torso_posture: np.ndarray) -> None:
        self.calls.append(("fix_torso", torso_posture.copy()))

    def arm(self, side: str, arm_postures: np.ndarray) -> np.ndarray:
        self.calls.append((side, arm_postures.copy()))
        return np.zeros(len(arm_postures), np.int64)

    def names(self) -> list[str]:
        return [name for name, _ in self.calls]


def on_constant_cost(
    config: TrackerConfig, image_px: int = IMAGE_PX
) -> tuple[HierarchicalFilter, ConstantCost]:
    cost = ConstantCost()
    config = replace(config, parallel_from=None)
    return HierarchicalFilter(cost, config, image_px, np.random.default_rng(0)), cost


def before_somebody(
    config: TrackerConfig, seed: int, posture: np.ndarray = FRONT
) -> HierarchicalFilter:
    cost = CompiledCost(BODY, CAMERA)
    cost.observe(render(cardbox_patches(BODY, posture), CAMERA))
    rng = np.random.default_rng(seed)
    return HierarchicalFilter(cost, config, CAMERA.width * CAMERA.height, rng)


@pytest.mark.parametrize("make_config", [paper_preset, default_preset])
@pytest.mark.parametrize("strategy", ["drs", "srs"])
@pytest.mark.parametrize("seed", range(3))
def test_arms_in_threads_give_what_they_give_one_after_the_other(
    make_config: Any, strategy: str, seed: int
) -> None:
    results = []
    for parallel_from in (0, None):
        config = replace(make_config(), strategy=strategy, parallel_from=parallel_from)
        filters = before_somebody(config, seed)
        postures = [filters.scatter(FRONT)]
        for cycle in range(8):
            postures.append(filters.cycle(0.6 ** (cycle % 3), 0.15 if cycle % 3 == 0 else 0.0))
        results.append(
            (
                np.array(postures),
                filters.stddev(postures[-1]),
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
    filters = HierarchicalFilter(cost, config, IMAGE_PX, np.random.default_rng(0))
    seen = set()

    def rate(side: str, arm_postures: np.ndarray) -> np.ndarray:
        seen.add(threading.get_ident())
        return np.zeros(len(arm_postures), np.int64)

    cost.arm = rate  # type: ignore[method-assign]
    filters.scatter(FRONT)
    assert len(seen) == threads


def test_an_error_in_the_other_thread_is_not_lost() -> None:
    filters, cost = on_constant_cost(paper_preset())
    config = replace(paper_preset(), parallel_from=0)
    filters = HierarchicalFilter(cost, config, IMAGE_PX, np.random.default_rng(0))

    def fail(side: str, arm_postures: np.ndarray) -> np.ndarray:
        if side == "left":
            raise RuntimeError("left arm")
        return np.zeros(len(arm_postures), np.int64)

    cost.arm = fail  # type: ignore[method-assign]
    with pytest.raises(RuntimeError, match="left arm"):
        filters.scatter(FRONT)


def test_the_torso_is_fixed_before_the_arms_are_rated() -> None:
    filters, cost = on_constant_cost(paper_preset())
    first = filters.scatter(FRONT)
    assert cost.names() == ["fix_arms", "torso", "fix_torso", "left", "right"]
    np.testing.assert_array_equal(cost.calls[0][1], FRONT)
    np.testing.assert_array_equal(cost.calls[2][1], first[TORSO])
    cost.calls.clear()
    second = filters.cycle()
    assert cost.names() == ["fix_arms", "torso", "fix_torso", "left", "right"]
    # The arms of the estimate before stand beside the torsos of this one.
    np.testing.assert_array_equal(cost.calls[0][1], first)
    np.testing.assert_array_equal(cost.calls[2][1], second[TORSO])


def test_the_torso_alone_is_rated_where_the_settings_say_so() -> None:
    filters, cost = on_constant_cost(replace(paper_preset(), torso_beside_arms=False))
    filters.scatter(FRONT)
    filters.cycle()
    assert "fix_arms" not in cost.names()


def test_particles_lie_around_the_posture_within_the_joint_limits() -> None:
    posture = FRONT.copy()
    posture[LEFT_ARM] = JOINT_LIMITS[LEFT_ARM, 1]
    posture[RIGHT_ARM] = JOINT_LIMITS[RIGHT_ARM, 0]
    filters, cost = on_constant_cost(paper_preset())
    filters.scatter(posture)
    for _ in range(5):
        filters.cycle(2.0, 0.2)
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
    filters.scatter(middle)
    expected = np.array([0.02, 0.1, 0.1, 0.1])
    np.testing.assert_allclose(filters.torso.particles.std(axis=0), expected, rtol=0.03)
    for arm in filters.arms.values():
        np.testing.assert_allclose(arm.particles.std(axis=0), 0.25, rtol=0.03)
    filters.scatter(middle, 0.5)
    np.testing.assert_allclose(filters.torso.particles.std(axis=0), expected / 2, rtol=0.03)


def test_every_filter_has_noise_of_its_own() -> None:
    filters, _ = on_constant_cost(paper_preset())
    filters.scatter(JOINT_LIMITS.mean(axis=1))
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
    filters.scatter(FRONT)
    filters.cycle(1.0, explore)
    assert np.all(filters.torso.particles == FRONT[TORSO])
    for side, joints in (("left", LEFT_ARM), ("right", RIGHT_ARM)):
        elsewhere = np.any(filters.arms[side].particles != FRONT[joints], axis=1)
        assert np.flatnonzero(elsewhere).tolist() == list(range(200 - explorers, 200))


def test_the_estimate_is_the_best_or_the_mean_of_the_best() -> None:
    """The prior makes costs differ; an image of four times the pixels spreads them four times."""
    for average, image_px, scale in ((1, IMAGE_PX, 1.0), (20, 4 * IMAGE_PX, 4.0)):
        config = replace(paper_preset(), prior=0.01, average=average)
        filters, _ = on_constant_cost(config, image_px)
        filters.scatter(FRONT)
        posture = filters.cycle()
        np.testing.assert_array_equal(posture[TORSO], filters.torso.mean(average, scale))
        np.testing.assert_array_equal(posture[LEFT_ARM], filters.arms["left"].mean(average, scale))
        is_particle = np.any(np.all(filters.torso.particles == posture[TORSO], axis=1))
        assert is_particle == (average == 1)
        stddev = filters.stddev(posture)
        np.testing.assert_array_equal(stddev[TORSO], filters.torso.stddev(posture[TORSO], scale))
        np.testing.assert_array_equal(
            stddev[RIGHT_ARM], filters.arms["right"].stddev(posture[RIGHT_ARM], scale)
        )


def test_without_a_prior_the_cost_is_that_of_the_pixels() -> None:
    filters, _ = on_constant_cost(paper_preset())
    filters.scatter(FRONT)
    assert not filters.torso.costs.any()
    assert not filters.arms["left"].costs.any()


def prior_px(joint: str, angle_rad: float) -> float:
    """The prior of one angle away from rest, where 0.01 of 1000 silhouette pixels is its unit."""
    config = replace(paper_preset(), prior=0.01)
    filters, _ = on_constant_cost(config)
    posture = np.zeros(12)
    posture[JOINT_NAMES.index(joint)] = angle_rad
    filters.scatter(posture)
    rated = {"torso": filters.torso, **filters.arms}[joint.split("_")[0]]
    return float(rated.costs[0])


@pytest.mark.parametrize(
    ("joint", "angle_rad", "expected_px"),
    [
        ("torso_y", 1.0, 0.0),
        ("torso_roll", np.radians(20), 10.0),
        ("torso_roll", np.radians(-40), 40.0),
        ("torso_pitch", np.radians(26), 10.0),
        # Leaning back counts three times the angle.
        ("torso_pitch", np.radians(-13), 22.5),
        ("torso_yaw", np.radians(-20), 10.0),
        # Flexion in units of a sixth of its range, 150 and 105 degrees; abduction of the whole.
        ("left_shoulder_flexion", np.radians(25), 10.0),
        ("right_elbow_flexion", np.radians(35), 40.0),
        ("right_shoulder_abduction", np.radians(112.5), 2.5),
        ("left_elbow_abduction", np.radians(-150), 2.5),
    ],
)
def test_the_prior_by_hand(joint: str, angle_rad: float, expected_px: float) -> None:
    assert prior_px(joint, angle_rad) == pytest.approx(expected_px)


def test_the_prior_leaves_the_particles_alone() -> None:
    filters, cost = on_constant_cost(replace(paper_preset(), prior=0.01))
    posture = FRONT.copy()
    posture[2] = -0.2
    filters.scatter(posture)
    np.testing.assert_array_equal(filters.torso.particles, dict(cost.calls)["torso"])
    assert filters.torso.particles[0, 2] == -0.2


@pytest.mark.parametrize("strategy", ["drs", "srs"])
def test_the_seed_decides_the_estimate(strategy: str) -> None:
    def run(seed: int) -> np.ndarray:
        filters = before_somebody(replace(default_preset(), strategy=strategy), seed)
        filters.scatter(FRONT)
        return filters.cycle(1.0, 0.15)

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.any(run(1) == run(2))


def test_an_arm_that_was_lost_is_found_by_exploring() -> None:
    """The arms are raised to where no noise of 0.25 rad reaches in a few cycles."""
    raised = FRONT.copy()
    raised[4] = raised[8] = np.radians(150)
    for seed in range(3):
        filters = before_somebody(default_preset(), seed, raised)
        filters.scatter(FRONT, 0.1)
        for _ in range(10):
            posture = filters.cycle(0.1, 0.3)
        assert filters._cost.overlap(posture)[1] > 0.75
