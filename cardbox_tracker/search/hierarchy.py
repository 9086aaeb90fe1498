"""The hierarchical particle filter: first the torso, then both arms (paper, section IV-B).

The torso filter rates torso, waist and head. Each arm filter then rates its arm beside the
estimated torso, so the two arms do not depend on each other. All filters run in one thread, because
with the paper's particles a second thread saves no time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from cardbox_tracker.person.posture import JOINT_LIMITS, N_JOINTS, N_STATE, POSTURE, TORSO, TORSO_Y
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.particle_filter import CostFunction, ParticleFilter
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Drawn
from cardbox_tracker.terms.term import (
    ARM,
    ARMS,
    TRUNK,
    ArmCosts,
    Posed,
    TermObservation,
    TorsoCosts,
)

_REFERENCE_AREA_PX = 320 * 240

RunFilter = Callable[[ParticleFilter, CostFunction, slice], None]
"""Runs one step of a filter; takes the filter, the costs of its particles, and its joints."""


class HierarchicalCost(Protocol):
    """What the filters rate their particles with."""

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`~cardbox_tracker.terms.silhouette.SilhouetteObservation`."""

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`~cardbox_tracker.terms.silhouette.SilhouetteObservation`."""


@dataclass(frozen=True)
class SumOfTerms:
    """The silhouette's cost and that of further terms."""

    silhouette: HierarchicalCost  #: the paper's cost
    terms: Sequence[TermObservation]  #: observations of further terms
    #: fields of :class:`~cardbox_tracker.terms.kernel_arguments.Body` with the paper's shoulders,
    #: which the arms do not raise.
    body: BodyTuple

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`HierarchicalCost`."""
        beside = self.silhouette.torsos_beside(arms)

        def costs(torsos: FloatArray) -> FloatArray:
            postures = np.zeros((len(torsos), N_JOINTS))
            postures[:, TORSO] = torsos
            return beside(torsos) + self._further(postures, TRUNK)

        return costs if self.terms else beside

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`HierarchicalCost`."""
        beside = self.silhouette.arms_beside(torso)

        def costs(side: str, arms: FloatArray) -> FloatArray:
            postures = np.zeros((len(arms), N_JOINTS))
            postures[:, TORSO], postures[:, ARMS[side]] = torso, arms
            return beside(side, arms) + self._further(postures, ARM[list(ARMS).index(side)])

        return costs if self.terms else beside

    def _further(self, postures: FloatArray, parts: Drawn) -> FloatArray:
        states = np.zeros((len(postures), N_STATE))
        states[:, POSTURE] = postures
        posed, total = Posed(self.body, states, parts), np.zeros(len(postures))
        for term in self.terms:
            total += term.rate(posed)
        return total


class HierarchicalFilter:
    """Three particle filters that share one observation."""

    def __init__(self, config: TrackerConfig, image_px: int, rng: np.random.Generator) -> None:
        """Create the filters; :meth:`initialize` creates their particles.

        Settings that refer to 320x240 are scaled to an image of ``image_px``; ``rng`` is split.
        """
        self._config = config
        self._scale = image_px / _REFERENCE_AREA_PX
        streams = rng.spawn(3)
        torso_noise = np.full(4, config.torso.rotation_noise_rad)
        torso_noise[TORSO_Y] = config.torso.translation_noise_m
        arm_noise = np.full(4, config.arm.rotation_noise_rad)
        self.torso = ParticleFilter(
            config.torso, config.strategy, torso_noise, JOINT_LIMITS[TORSO], streams[0]
        )
        self.arms = {
            side: ParticleFilter(
                config.arm, config.strategy, arm_noise, JOINT_LIMITS[joints], stream
            )
            for (side, joints), stream in zip(ARMS.items(), streams[1:], strict=True)
        }
        self._estimate = np.zeros(N_JOINTS)

    def initialize(
        self, observation: HierarchicalCost, posture: FloatArray, noise_scale: float = 1.0
    ) -> None:
        """Start all filters around ``posture`` (12,) on a first observation."""
        self._estimate = posture

        def run(of: ParticleFilter, evaluate: CostFunction, joints: slice) -> None:
            of.initialize(posture[joints], evaluate, noise_scale)

        self._run(observation, run)

    def iterate(self, observation: HierarchicalCost, noise_scale: float = 1.0) -> None:
        """Run one estimation cycle of all filters, with ``noise_scale`` as factor on sigma_beta."""

        def run(of: ParticleFilter, evaluate: CostFunction, joints: slice) -> None:
            of.iterate(evaluate, noise_scale, self._scale)

        self._run(observation, run)

    def _run(self, observation: HierarchicalCost, run: RunFilter) -> None:
        """Call ``run`` for the torso's filter, then for the arms' filters beside that torso."""
        average = self._config.average
        posture = np.empty(N_JOINTS)
        arms = self._estimate if self._config.torso_beside_arms else None
        run(self.torso, observation.torsos_beside(arms), TORSO)
        posture[TORSO] = self.torso.mean(average, self._scale)

        arm_costs = observation.arms_beside(posture[TORSO])
        for side, joints in ARMS.items():
            run(self.arms[side], partial(arm_costs, side), joints)
            posture[joints] = self.arms[side].mean(average, self._scale)
        self._estimate = posture

    def estimate(self) -> FloatArray:
        """Return the posture (12,) of the latest step: best particles, or means of the best."""
        return self._estimate.copy()

    def stddev(self) -> FloatArray:
        """Return the standard deviation (12,) of the particles around the estimate."""
        stddev = np.empty(N_JOINTS)
        for of, joints in ((self.torso, TORSO), *((self.arms[s], ARMS[s]) for s in ARMS)):
            stddev[joints] = of.stddev(self._estimate[joints], self._scale)
        return stddev
