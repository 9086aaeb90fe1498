"""The whole-body filter: a few dozen whole postures survive from frame to frame.

A frame is searched in stages, each with the best of the one before: torsos, then each arm beside
the best torso, then all joints together. ``docs/architecture.md`` has the steps with their numbers
and what was tried. What proposes is in :mod:`.whole_body_moves`, what rates in
:mod:`cardbox_tracker.estimation.cost.whole_body`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.posture import (
    N_JOINTS,
    N_STATE,
    STATE_LIMITS,
    TORSO_X,
    TORSO_Z,
    reference_posture,
)
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.kernel_arguments import BOTTOM, HEIGHT, TORSO
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import Frame, Term
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.estimation.filtering import (
    arm_proposals,
    joint_moves,
    loss,
    state_choice,
    torso_proposals,
)
from cardbox_tracker.estimation.filtering.arms import ARM_LIMITS, propose_arms
from cardbox_tracker.estimation.filtering.draws import Draws
from cardbox_tracker.estimation.filtering.particles import Particles
from cardbox_tracker.estimation.filtering.pose_filter import Fit, Sight, sight_of
from cardbox_tracker.estimation.filtering.refinement import Refinement
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.estimation.filtering.walking import Walk

_HOME_LIMIT_M = 0.7
# Deviation of x of torsos that stand upright: larger while the search is young.
_SETTLED_FRAMES, _SETTLED_X_M, _YOUNG_X_M = 15, 0.25, 0.5
# Arms that are passed on, how many of them are combined with the other side's, and the noise around
# the best, as a share of that of all.
_BEST_ARMS, _PAIRED_ARMS, _AGAIN_NOISE = 20, 12, 0.45
_STEP_M = 0.05  # across the image: the legs leave the columns where they were


class WholeBodyFilter:
    """Follows states (14,); a :class:`~.pose_filter.PoseFilter`.

    A state is d1..d12, ``torso_x`` and ``torso_z``. What is done to results is in ``refine``.
    """

    candidates = 1
    """Arms that are proposed for each one that is rated."""

    def __init__(
        self, config: TrackerConfig, silhouette: SilhouetteTerm, rng: np.random.Generator
    ) -> None:
        """Prepare, and compile what is not yet; see ``MakeFilter``."""
        self._config = c = config.whole_body
        self._rng, self._lost_iou = rng, config.lost_iou
        self.use_body(silhouette)
        self._sigma = c.noise()
        self._torso_sigma = self._sigma.copy()
        self._torso_sigma[4:12] = 0.0
        self._reference = np.zeros(N_STATE)
        self._reference[:N_JOINTS] = reference_posture("front")
        self._reference[0] = self._body.placement.lateral_m
        self.forget()

    def use_body(self, silhouette: SilhouetteTerm) -> None:
        """Go on with another body from the next frame on, or begin with it."""
        self._body = silhouette.body
        self._one = WholeBodyCost(silhouette.body, silhouette.camera, self._config.cost)
        self._cost: WholeBodyCost | MultiViewCost = self._one
        self.refine = Refinement(self._one, silhouette.camera, self._config)
        # From the hips to the torso's top: about where the shoulders are.
        self._lever_m = float(self._one.parts[TORSO, BOTTOM] + self._one.parts[TORSO, HEIGHT])

    def best(self) -> tuple[WholeBodyCost, FloatArray]:
        """Return what has rated the last frame, of the first camera, and the best state (14,)."""
        return self._one, self.states[int(np.argmin(self.ratings))]

    def forget(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`."""
        self._survivors = self._reference[None].copy()
        self._is_new, self._is_lost = True, False
        self._age, self._home_m = 0, 0.0
        self._walk = Walk()
        self._output: FloatArray | None = None
        self.refine.forget()
        # Of left elbow and hand, right elbow and hand, m.
        self._arm_spread = [0.0, 0.0, 0.0, 0.0]
        self._chance: float | None = None

    def recover(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`: the search goes on, and somebody upright joins it.

        To forget would cost more than it brings where silhouettes stay poor.
        """
        self._is_lost = True
        # What was wrong is not shown, nor is the next result mixed with it.
        self._output = None
        self.refine.forget()

    def configure(self, config: TrackerConfig) -> None:
        """See :class:`~.pose_filter.PoseFilter`: every other setting of this filter restarts."""
        self._lost_iou = config.lost_iou

    def look(self, frame: Frame) -> Sight:
        """See :class:`~.pose_filter.PoseFilter`."""
        self._frame = frame
        self._see(self._survivors[0])
        return self._sight_of(self._cost.silhouette_px, self._cost.frontal_px)

    def _sight_of(self, silhouette_px: int, frontal_px: int) -> Sight:
        share = silhouette_px / frontal_px
        return sight_of(share, self._config.smallest_person, self._config.largest_person)

    def follow(self, terms: Sequence[Term]) -> Fit:
        """See :class:`~.pose_filter.PoseFilter`."""
        self._observe(terms)
        passes = self._config.start_passes if self._is_new else 1
        if self._is_new or self._is_lost:
            self._home_m = 0.0
            self._survivors[-1] = self._reference
            place_m = self._sight * self._body.placement.distance_m
            self._survivors[-1, 0] = np.clip(place_m, *STATE_LIMITS[0])
        moved = self._survivors[0].copy()
        moved[0] += self._step_m
        if self._is_new or abs(self._step_m) > _STEP_M:
            # Now it is known where the legs are.
            self._see(moved)
        self._age += not self._is_new
        for _ in range(passes):
            self._search()
        self._is_new = self._is_lost = False
        return self._fit()

    def _see(self, state: FloatArray) -> None:
        """Take the silhouette of the frame, of a person about where ``state`` (14,) says."""
        self._one.see(self._frame.silhouette, state)

    def _observe(self, terms: Sequence[Term]) -> None:
        """See what the terms say of the frame, and where its silhouette is and has moved."""
        self._one.terms = tuple(term.observe(self._frame) for term in terms)
        self._sight = self._one.sight()
        ahead_m = self._body.placement.distance_m - float(self._survivors[0, TORSO_X])
        self._step_m = self._walk.see(self._frame.silhouette, self._sight, ahead_m)

    def _search(self) -> None:
        """Run all stages once."""
        config, cost = self._config, self._cost
        draws = Draws(self._rng, config, self.candidates)
        before = self._survivors[0].copy()
        self._home_m += config.home_rate * (before[TORSO_X] - self._home_m)
        self._home_m = min(max(self._home_m, -_HOME_LIMIT_M), _HOME_LIMIT_M)
        cost.anchor[:] = before[TORSO_X], before[TORSO_Z], self._home_m, self._walk.yaw_rad

        pool = self._torsos(before, draws)
        ratings = cost.bodies(pool)[0]
        best = pool[np.argmin(ratings)]
        by_rating = state_choice.best_states(pool, ratings, min(len(pool), config.survivors))
        cost.fix_torso(best)
        (left, left_ratings), (right, right_ratings) = (
            self._arm(by_rating, arm, draws) for arm in (0, 1)
        )
        pairs = joint_moves.combine(best, left, left_ratings, right, right_ratings, _PAIRED_ARMS)
        states = np.concatenate([pool, pairs])
        ratings = np.concatenate([ratings, cost.bodies(pairs)[0]])
        self._together(states, ratings, draws)

    def _torsos(self, before: FloatArray, draws: Draws) -> FloatArray:
        """Return whole states (N, 14): the survivors, and the best of other torsos with arms."""
        config, cost = self._config, self._cost
        is_settled = not self._is_new and self._age > _SETTLED_FRAMES
        fresh = self._reference.copy()
        fresh[TORSO_X], sight, fresh_x_m = self._upright(before, is_settled)
        upright = config.fresh_torsos if is_settled else config.torso_explorers
        torsos = torso_proposals.propose_torsos(
            self._survivors,
            (self._torso_sigma, STATE_LIMITS, self._lever_m),
            self._step_m,
            config.torso_explorers,
            (upright, fresh, fresh_x_m, sight, self._body.placement.distance_m),
            draws.for_torsos(config.torsos),
        )
        ratings = cost.torsos(torsos, before)
        pool = torso_proposals.pool_of(
            self._survivors, torsos, ratings, config.best_torsos, before, cost.body, ARM_LIMITS
        )
        # Their arms hang; those of the last frame, with which torsos are rated, would hide it.
        return np.concatenate([pool, torsos[len(torsos) - upright :]])

    def _upright(self, before: FloatArray, is_settled: bool) -> tuple[float, float, float]:
        """Return x and direction of torsos that stand upright, and the deviation of x, m."""
        return float(before[TORSO_X]), self._sight, _SETTLED_X_M if is_settled else _YOUNG_X_M

    def _propose_arms(
        self, pool: FloatArray, arm: int, normals: FloatArray, uniforms: FloatArray
    ) -> FloatArray:
        """Return arms (N, 4), 0 left or 1 right, for the torso of the best state."""
        return propose_arms(pool, arm, self._config, self._one, (normals, uniforms))

    def _arm(self, pool: FloatArray, arm: int, draws: Draws) -> tuple[FloatArray, FloatArray]:
        """Return arms (N, 4), 0 left or 1 right, for the torso of the best state, and ratings."""
        config, cost = self._config, self._cost
        arms = self._propose_arms(pool, arm, *draws.for_arms(self.candidates * config.arms))
        ratings = cost.arms(arms, arm)
        self._arm_spread[2 * arm : 2 * arm + 2] = state_choice.spread_of_arm(
            arms, ratings, 1.0 - 2.0 * arm, config.spread, cost.parts, cost.girdle
        )
        near = arm_proposals.around_best(
            arms,
            ratings,
            _BEST_ARMS,
            _AGAIN_NOISE * config.arm_noise_rad,
            ARM_LIMITS,
            draws.for_near_arms(self.candidates * config.arms_again),
        )
        near = self._promising(near, arm)
        return np.concatenate([arms, near]), np.concatenate([ratings, cost.arms(near, arm)])

    def _promising(self, arms: FloatArray, arm: int) -> FloatArray:
        """Return one of each ``candidates`` arms (N, 4), 0 left or 1 right."""
        return arms

    def _together(self, states: FloatArray, ratings: FloatArray, draws: Draws) -> None:
        """Move all joints of the best together; then choose who survives."""
        config, cost = self._config, self._cost
        sigma = config.together_noise * self._sigma
        for number in range(config.rounds):
            if number == 0:
                sources = self._apart(states, ratings)
            else:
                sources = state_choice.best_states(
                    states, ratings, min(config.survivors, len(states))
                )
            moved = joint_moves.move_all(
                sources,
                (sigma, STATE_LIMITS, self._lever_m),
                int(config.differing * config.together),
                config.difference_scale,
                draws.for_states(config.together),
            )
            states = np.concatenate([states, moved])
            ratings = np.concatenate([ratings, cost.bodies(moved)[0]])
            sigma = config.round_decay * sigma
        self.states, self.ratings = states, ratings
        self._survivors = self._apart(states, ratings)

    def _apart(self, states: FloatArray, ratings: FloatArray) -> FloatArray:
        c, cost = self._config, self._cost
        kept = (c.survivors, c.alike, c.apart_m)
        return states[state_choice.choose_apart(states, ratings, *kept, cost.parts, cost.girdle)]

    def _fit(self) -> Fit:
        """Return the smoothed mean of the best states, and how far to believe it."""
        config, cost, frame = self._config, self._cost, self._frame
        rated = self.states, self.ratings
        mean, stddev = state_choice.mean_and_spread(*rated, config.average, config.spread)
        before = mean if self._output is None else self._output
        self._output = config.smoothing * before + (1.0 - config.smoothing) * mean
        spread, total = loss.state_stddev(stddev), cost.silhouette_px
        fitted = self.refine.outline(frame, self._output)
        _, costs_px, areas_px = cost.bodies(np.array([mean, fitted]))
        fit_iou = iou_of(total, areas_px[1], costs_px[1])
        seen = total, cost.frontal_px, costs_px[0], areas_px[0], float(self.ratings.min())
        evidence = loss.evidence_of(*seen, sum(self._arm_spread) / 4, stddev, mean, self._age)
        self._chance = loss.remembered(loss.chance_of_loss(evidence), self._chance)
        search = Search(*rated, config.spread, evidence, self._chance)
        result = self.refine.corrected(frame, fitted, spread, fit_iou, search)
        _, (cost_px,), (area_px,) = cost.bodies(result[None])
        iou = iou_of(total, area_px, cost_px)
        keypoints_m = cost.keypoints(result)
        deviations = self.refine.deviations(frame, result, spread, keypoints_m, iou)
        return Fit(
            posture=result[:N_JOINTS],
            posture_stddev=deviations[:N_JOINTS],
            keypoints_m=keypoints_m,
            cost_px=int(cost_px),
            iou=iou,
            is_uncertain=self._chance > config.uncertain_from,
            is_poor=self._chance > config.lost_from or fit_iou < self._lost_iou,
            offset_m=result[N_JOINTS:],
            offset_stddev_m=deviations[N_JOINTS:],
            seen=fitted,
            seen_iou=fit_iou,
            particles=Particles(*rated, mean, config.spread, deviations / spread),
        )
