"""The hierarchical particle filter: first the torso, then both arms (paper, section IV-B).

The torso filter rates torso, waist and head. Each arm filter then rates its arm beside the
estimated torso, so the two arms do not depend on each other. All filters run in one thread, because
with the paper's particles a second thread saves no time. :class:`Cycles` is what the tracker sees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from typing import Protocol

import numpy as np

from cardbox_tracker.camera.camera import WORKING_SIZE
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import View
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.posture import (
    JOINT_LIMITS,
    N_JOINTS,
    N_STATE,
    POSTURE,
    TORSO,
    TORSO_Y,
    clip_to_limits,
    reference_posture,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import doubt
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.particle_filter import CostFunction, ParticleFilter
from cardbox_tracker.search.pose_filter import Fit, Presence
from cardbox_tracker.terms.kernel_arguments import BodyTuple, Drawn, body_tuple
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import (
    ARM,
    ARMS,
    TRUNK,
    ArmCosts,
    Frame,
    Posed,
    Silhouette,
    Term,
    TermObservation,
    TorsoCosts,
)

# A person from the side has about half the area of the front view, and less at the border.
_PERSON_FRACTION = 0.25
_RECOVERY_CYCLES = 4
_RECOVERY_NOISE = 2.0

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
        self._scale = image_px / prod(WORKING_SIZE)
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


MakeHierarchy = Callable[[TrackerConfig, int, np.random.Generator], HierarchicalFilter]


class Cycles:
    """The paper's algorithm "Online Motion Tracking" as a :class:`~.pose_filter.PoseFilter`."""

    def __init__(
        self,
        config: TrackerConfig,
        silhouette: SilhouetteTerm,
        rng: np.random.Generator,
        views: Sequence[View] = (),
        make_hierarchy: MakeHierarchy = HierarchicalFilter,
    ) -> None:
        """Prepare as ``MakeFilter``; raise ValueError if there are ``views``, as it has one camera.

        ``make_hierarchy`` takes settings, pixels of an image and random numbers.
        """
        if views:
            raise ValueError("the filter hierarchical has one camera; whole_body takes several")
        self._config, self._term = config, silhouette
        body, camera = silhouette.body, silhouette.camera
        self.hierarchy = make_hierarchy(config, camera.width * camera.height, rng)
        self._rigid = body.rigid
        self._posable = body_tuple(self._rigid, camera)
        self._reference = reference_posture("front")
        self._reference[TORSO_Y] = body.placement.lateral_m
        model = render(cardbox_patches(body, self._reference), camera, silhouette.rows)
        self._person_px = max(1, int(np.count_nonzero(model)))
        self._min_person_px = max(1, int(_PERSON_FRACTION * np.count_nonzero(model)))
        self._doubt = doubt.Doubt()
        self._started = False
        self._iou: float | None = None

    def ious(self) -> list[float | None]:
        """See :class:`PoseFilter`."""
        return [self._iou]

    def look(self, frames: Sequence[Frame]) -> Presence:
        """See :class:`PoseFilter`."""
        self._iou = None
        is_there = frames[0].foreground_px >= self._min_person_px
        return Presence.PERSON if is_there else Presence.NOBODY

    def forget(self) -> None:
        """See :class:`PoseFilter`."""
        self._started = False
        self._doubt.forget()

    def recover(self) -> None:
        """See :class:`PoseFilter`."""
        self._started = False

    def configure(self, config: TrackerConfig) -> None:
        """See :class:`PoseFilter`."""
        self._config = config

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """See :class:`PoseFilter`."""
        (frame,), (further,) = frames, terms
        seen = self._term.observe(frame)
        observed = (term.observe(frame) for term in further)
        observation = SumOfTerms(seen, [one for one in observed if one is not None], self._posable)
        if self._started:
            for _ in range(self._config.cycles):
                self.hierarchy.iterate(observation)
        else:
            self._start(frame, observation)
        posture = self.hierarchy.estimate()
        cost_px, iou = seen.overlap(posture)
        self._iou = iou
        is_poor = iou < self._config.lost_iou
        keypoints_m = pose(self._rigid, posture, self._term.camera.pitch_rad).keypoints_m
        stddev = self.hierarchy.stddev()
        area = frame.foreground_px / self._person_px
        evidence = doubt.evidence_of_particles(iou, area, posture, stddev, self._posable)
        judged = self._doubt.judge(evidence, doubt.Source.PAPER, np.zeros(6, np.bool_))
        return Fit(posture, stddev, keypoints_m, cost_px, iou, is_poor, judged=judged)

    def _start(self, frame: Frame, observation: SumOfTerms) -> None:
        """Start around the front reference at the person's place, then run the first cycles."""
        self._started = True
        reference = self._reference.copy()
        if self._config.relocalize:
            reference[TORSO_Y] = self._lateral_m(frame.silhouette)
        self.hierarchy.initialize(observation, clip_to_limits(reference))
        if self._config.relocalize:
            for _ in range(_RECOVERY_CYCLES):
                self.hierarchy.iterate(observation, _RECOVERY_NOISE)

    def _lateral_m(self, silhouette: Silhouette) -> float:
        """Return ``torso_y`` of the silhouette's median column, metres."""
        camera = self._term.camera
        columns = np.count_nonzero(silhouette[: self._term.rows], axis=0).cumsum()
        middle = int(np.searchsorted(columns, columns[-1] / 2))
        offset_m = (middle - camera.cx) / camera.fx * self._term.body.placement.distance_m
        return float(offset_m)
