"""The hierarchy: torso first, then both arms, whichever of them finishes first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    JOINT_LIMITS,
    LEFT_ARM,
    RIGHT_ARM,
    TORSO,
    reference_posture,
)
from cardbox_tracker.search.config import TrackerConfig, paper_preset
from cardbox_tracker.search.hierarchy import HierarchicalFilter, SumOfTerms
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.term import ARMS, ArmCosts, Posed, TermObservation, TorsoCosts

CAMERA = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
BODY = BodyModel.of(hip_height_m=-0.51)
POSABLE = body_tuple(BODY.rigid, CAMERA)
FRONT = reference_posture("front")
IMAGE_PX = 320 * 240
SEVERAL_CYCLES = TrackerConfig(cycles=2, average=20)


class FarFromRest:
    """An observation that rates angles by their squares, 10 px for each rad^2."""

    def torsos_beside(self, arms: np.ndarray | None) -> TorsoCosts:
        return self.squares

    def arms_beside(self, torso: np.ndarray) -> ArmCosts:
        return lambda side, arms: self.squares(arms)

    def squares(self, angles: np.ndarray) -> np.ndarray:
        return 10.0 * np.sum(angles**2, axis=1)


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

    def iterate(self, noise_scale: float = 1.0) -> np.ndarray:
        self.filters.iterate(self.observation, noise_scale)
        return self.filters.estimate()


def on_constant_cost(
    config: TrackerConfig, image_px: int = IMAGE_PX
) -> tuple[Stepped, ConstantCost]:
    cost = ConstantCost()
    filters = HierarchicalFilter(config, image_px, np.random.default_rng(0))
    return Stepped(filters, cost), cost


def before_somebody(config: TrackerConfig, seed: int, posture: np.ndarray = FRONT) -> Stepped:
    term = CompiledSilhouette(BODY, CAMERA)
    frame = term.frame(render(cardbox_patches(BODY, posture), CAMERA))
    rng = np.random.default_rng(seed)
    filters = HierarchicalFilter(config, CAMERA.width * CAMERA.height, rng)
    return Stepped(filters, SumOfTerms(term.observe(frame), (), POSABLE))


class HandsUp(TermObservation):
    """A term that likes high hands, and knows which parts it was asked about."""

    def __init__(self) -> None:
        self.asked: list[Posed] = []

    def rate(self, posed: Posed) -> np.ndarray:
        self.asked.append(posed)
        rows = posed.keypoints_px[:, [2, 5], 1]
        return 100.0 * np.nansum(rows, axis=1)


def test_further_terms_rate_trunks_and_arms_beside_them() -> None:
    term = CompiledSilhouette(BODY, CAMERA)
    seen = term.look(render(cardbox_patches(BODY, FRONT), CAMERA))
    further = HandsUp()
    alone, both = (SumOfTerms(seen, terms, POSABLE) for terms in ((), (further, HandsUp())))
    rng = np.random.default_rng(0)
    torsos, arms = rng.normal(0.0, 0.1, (5, 4)), rng.normal(0.5, 0.3, (5, 4))
    # No hand counts beside a trunk.
    np.testing.assert_array_equal(
        both.torsos_beside(FRONT)(torsos), alone.torsos_beside(FRONT)(torsos)
    )
    assert further.asked[-1].parts == (True, False, False)
    np.testing.assert_array_equal(further.asked[-1].states[:, TORSO], torsos)
    for side, joints in ARMS.items():
        more = both.arms_beside(torsos[0])(side, arms) - alone.arms_beside(torsos[0])(side, arms)
        asked = further.asked[-1]
        assert asked.parts == (False, side == "left", side == "right")
        np.testing.assert_array_equal(asked.states[:, joints], arms)
        np.testing.assert_array_equal(asked.states[:, TORSO], np.tile(torsos[0], (5, 1)))
        hands = [
            CAMERA.project(CAMERA.reference_to_optical(pose(BODY.rigid, one[:12]).keypoints_m))[
                2 if side == "left" else 5
            ]
            for one in asked.states
        ]
        np.testing.assert_allclose(more, 200.0 * np.array(hands)[:, 1], rtol=1e-9)
    # What is rated is not written to.
    again = np.random.default_rng(0)
    np.testing.assert_array_equal(torsos, again.normal(0.0, 0.1, (5, 4)))
    np.testing.assert_array_equal(arms, again.normal(0.5, 0.3, (5, 4)))


def test_a_further_term_moves_the_estimate() -> None:
    """It outweighs the silhouette of hanging arms."""
    found = []
    for terms in ((), (HandsUp(),)):
        filters = before_somebody(SEVERAL_CYCLES, 0)
        filters.observation = replace(filters.observation, terms=terms)
        filters.initialize(FRONT)
        posture = [filters.iterate() for _ in range(10)][-1]
        hands_m = pose(BODY.rigid, posture).keypoints_m[[2, 5], 2]
        found.append(hands_m)
    assert (found[1] > found[0] + 0.2).all()


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
        filters.iterate(2.0)
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


def test_the_estimate_is_the_best_or_the_mean_of_the_best() -> None:
    """An image of four times the pixels spreads them four times."""
    for average, image_px, scale in ((1, IMAGE_PX, 1.0), (20, 4 * IMAGE_PX, 4.0)):
        config = replace(paper_preset(), average=average)
        of = HierarchicalFilter(config, image_px, np.random.default_rng(0))
        filters = Stepped(of, FarFromRest())
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
        return filters.iterate()

    np.testing.assert_array_equal(run(1), run(1))
    assert not np.any(run(1) == run(2))
