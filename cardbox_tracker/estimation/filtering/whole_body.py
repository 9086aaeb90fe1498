"""The whole-body filter: a few dozen whole postures survive from frame to frame.

A frame is searched in stages, each of which starts with the best states of the previous one:
torsos, then each arm beside the best torso, then all joints together (``docs/architecture.md``).
Proposals are in :mod:`.torso_proposals`, :mod:`.arm_search` and :mod:`.joint_moves`, ratings in
:mod:`cardbox_tracker.estimation.cost.multi_view`. :mod:`.search_plan` has all parameters that
depend on the number of cameras.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.parts import BOTTOM, HEIGHT, TORSO
from cardbox_tracker.body.posture import (
    LEFT_ARM,
    PLACE,
    POSTURE,
    RIGHT_ARM,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
)
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import Frame, Term
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import iou_of
from cardbox_tracker.estimation.filtering import (
    joint_moves,
    loss,
    state_choice,
    torso_proposals,
)
from cardbox_tracker.estimation.filtering.approach import Approach
from cardbox_tracker.estimation.filtering.arm_search import ArmSearch
from cardbox_tracker.estimation.filtering.arms import ARM_LIMITS
from cardbox_tracker.estimation.filtering.draws import Draws
from cardbox_tracker.estimation.filtering.evidence import evidence_in
from cardbox_tracker.estimation.filtering.keypoint_states import HANDS, are_sure, judged
from cardbox_tracker.estimation.filtering.locating import Location, Locator
from cardbox_tracker.estimation.filtering.particles import Particles
from cardbox_tracker.estimation.filtering.point_fit import PointFit
from cardbox_tracker.estimation.filtering.pose_filter import Fit, Presence
from cardbox_tracker.estimation.filtering.presence import PersonPresence
from cardbox_tracker.estimation.filtering.rated_states import RatedStates
from cardbox_tracker.estimation.filtering.refinement import Refinement
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.estimation.filtering.search_plan import SearchPlan
from cardbox_tracker.estimation.filtering.visibility import is_trackable

# Deviation of ``torso_x`` of upright torsos, which is larger in the first frames of a search.
_SETTLED_FRAMES, _SETTLED_X_M, _YOUNG_X_M = 15, 0.25, 0.5
# Lateral step, m, after which the legs have left their last columns.
_STEP_M = 0.05


class WholeBodyFilter:
    """Tracks states (14,) of the first camera; a :class:`~.pose_filter.PoseFilter`.

    A state is d1..d12, ``torso_x`` and ``torso_z``. :attr:`refine` post-processes the result. Each
    of several cameras may show no person for a while.

    Attributes:
        rated: rated states of the last frame.
        refine: fits the result to the outlines, corrects it, and estimates its deviations.
        approach: expects and proposes distances of the person.
    """

    def __init__(
        self,
        config: TrackerConfig,
        silhouette: SilhouetteTerm,
        rng: np.random.Generator,
        views: Sequence[View] = (),
    ) -> None:
        """Prepare, and compile the kernels if necessary; see ``MakeFilter``."""
        self._views = tuple(views)
        self._plan = plan = SearchPlan.of(config.whole_body.scaled(), 1 + len(views))
        self._config = c = plan.config
        self._rng, self._lost_iou = rng, config.lost_iou
        self._use_body(silhouette)
        self._sigma = c.noise()
        self._torso_sigma = self._sigma.copy()
        self._torso_sigma[LEFT_ARM] = self._torso_sigma[RIGHT_ARM] = 0.0
        self._reference = self._body.reference_state()
        self.approach = Approach(c.home_rate)
        self.forget()

    def _use_body(self, silhouette: SilhouetteTerm) -> None:
        """Prepare rating and refinement for the body of ``silhouette``."""
        self._body, camera, views = silhouette.body, silhouette.camera, self._views
        self._cost = cost = MultiViewCost(self._body, camera, views, self._config.cost)
        first, *others = cost.costs
        self._presence = PersonPresence(cost, self._config)
        self._arm = ArmSearch(cost, self._plan.config)
        self._points = PointFit(cost, self._config.cost, views)
        self._locator = Locator(cost, self._body.placement.distance_m, views, self._plan.crosses)
        self.refine = Refinement(first, camera, self._config, list(zip(others, views, strict=True)))
        # The height of the torso's top above the hips is about that of the shoulders.
        self._lever_m = float(cost.parts[TORSO, BOTTOM] + cost.parts[TORSO, HEIGHT])

    def forget(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`."""
        self._survivors = self._reference[None].copy()
        self._seeing: list[int] = []
        self._is_new, self._is_lost = True, False
        self._age = 0
        self._presence.forget()
        self.approach.begin(0.0)
        self._locator.forget()
        self._output: FloatArray | None = None
        self.refine.forget()
        self._arm.forget()
        self._chance: float | None = None

    def recover(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`; an upright state is added to the search.

        The survivors are kept, because the silhouettes may stay poor for a while.
        """
        self._is_lost = True
        # A wrong result must not be smoothed into the next one.
        self._output = None
        self.refine.forget()

    def configure(self, config: TrackerConfig) -> None:
        """See :class:`~.pose_filter.PoseFilter`; all other settings of this filter restart it."""
        self._lost_iou = config.lost_iou

    def look(self, frames: Sequence[Frame]) -> Presence:
        """See :class:`~.pose_filter.PoseFilter`; one camera that shows a person is enough."""
        self._cost.see([frame.silhouette for frame in frames], self._survivors[0])
        presence, self._seeing = self._presence.see(frames, self._survivors[0])
        self._is_lost = self._is_lost or self._presence.is_elsewhere
        return presence

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """See :class:`~.pose_filter.PoseFilter`."""
        location = self._observe(frames, terms)
        passes = self._config.start_passes if self._is_new else 1
        if self._is_new or self._is_lost:
            given = self._survivors, self._reference, location.bearing, self._is_new
            self._survivors = self.approach.with_upright(self._cost, frames, *given)
        moved = self._survivors[0].copy()
        moved[TORSO_Y] += location.step_m
        if self._is_new or abs(location.step_m) > _STEP_M:
            # The pixels of the legs depend on the place of the person.
            self._cost.see([frame.silhouette for frame in frames], moved)
            self._cost.choose(self._seeing)
        self._age += not self._is_new
        for _ in range(passes):
            self._search(frames, location)
        self._is_new = self._is_lost = False
        return self._fit(frames)

    def _observe(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Location:
        """Set the observations of the terms, and return the place of the person."""
        seeing, cost = self._seeing, self._cost
        self.refine.see(seeing)
        location = self._locator.locate(frames, seeing, self._survivors[0])
        cost.choose(seeing)
        cost.observe(frames, terms)
        self._points.see()
        return location

    def _search(self, frames: Sequence[Frame], location: Location) -> None:
        """Run all stages once."""
        config, cost = self._config, self._cost
        draws = Draws(self._rng, config)
        before = self._survivors[0].copy()
        approach, z_m = self.approach, float(before[TORSO_Z])
        approach.see(float(before[TORSO_X]))
        cost.expect(approach.expected_m, z_m, approach.home_m, self._locator.yaw_rad)

        pool, upright = self._torsos(before, location, draws)
        self.rated = rated = RatedStates(cost)
        rated.add(pool)
        best = rated.best(config.survivors)
        if (self._is_new or self._is_lost) and len(pool[upright]):
            # Its own arms make a wrong torso better than an upright one with hanging arms.
            standing = pool[upright][np.argmin(rated.ratings[upright])]
            self._add_arms(np.concatenate([standing[None], best]), Draws(self._rng, config))
        self._add_arms(best, draws)
        self._together(frames, draws)

    def _add_arms(self, pool: FloatArray, draws: Draws) -> None:
        """Search arms for the torso of the first state of a pool (M, 14), and rate their pairs."""
        self._cost.fix_torso(pool[0])
        left, right = (self._arm(pool, arm, draws) for arm in (0, 1))
        most = self._config.paired_arms
        self.rated.add_pairs(joint_moves.combine(pool[0], *left, *right, most))

    def _torsos(
        self, before: FloatArray, location: Location, draws: Draws
    ) -> tuple[FloatArray, slice]:
        """Return states (N, 14), survivors and new torsos with arms, and where upright ones are."""
        config, cost = self._config, self._cost
        is_settled = not self._is_new and self._age > _SETTLED_FRAMES
        fresh = self._reference.copy()
        fresh[TORSO_X] = before[TORSO_X] if location.x_m is None else location.x_m
        fresh_x_m = location.x_stddev_m or (_SETTLED_X_M if is_settled else _YOUNG_X_M)
        upright = config.fresh_torsos if is_settled else config.torso_explorers
        torsos = torso_proposals.propose_torsos(
            self._survivors,
            (self._torso_sigma, cost.limits, self._lever_m),
            location.step_m,
            config.torso_explorers,
            (upright, fresh, fresh_x_m, location.bearing, self._body.placement.distance_m),
            draws.for_torsos(config.torsos),
        )
        ratings = cost.torsos(torsos, before)
        pool = torso_proposals.pool_of(
            self._survivors, torsos, ratings, config.best_torsos, before, cost.body, ARM_LIMITS
        )
        # Upright torsos were rated with the arms of the last frame, but keep their hanging arms.
        more = [torsos[len(torsos) - upright :], self.approach.nearer_and_farther(before, cost)]
        if self._points.is_given:
            more.append(self._points.torsos(self._survivors, before, self._reference))
        return np.concatenate([pool, *more]), slice(len(pool), len(pool) + upright)

    def _together(self, frames: Sequence[Frame], draws: Draws) -> None:
        """Move all joints of the best states together; then choose the survivors."""
        config, cost, rated = self._config, self._cost, self.rated
        if self._plan.fits_outlines:
            rated.add(self.refine.outline.different(frames, rated))
        if self._points.is_given:
            rated.add(self._points.bodies(rated))
        sigma = config.together_noise * self._sigma
        different = config.survivors, config.alike, config.apart_m
        sources = rated.different(*different)
        for number in range(config.rounds):
            if number > 0:
                sources = rated.best(config.survivors)
            moved = joint_moves.move_all(
                sources,
                (sigma, cost.limits, self._lever_m),
                int(config.differing * config.together),
                config.difference_scale,
                draws.for_states(config.together),
            )
            rated.add(moved)
            sigma = config.round_decay * sigma
        self._survivors = rated.different(*different)

    def _fit(self, frames: Sequence[Frame]) -> Fit:
        """Return the refined mean of the best states with its confidence."""
        config, cost, frame = self._config, self._cost, frames[0]
        rated = self.rated.states, self.rated.ratings
        mean, stddev = state_choice.mean_and_spread(*rated, config.average, config.spread)
        before = mean if self._output is None else self._output
        self._output = config.smoothing * before + (1.0 - config.smoothing) * mean
        spread, total = loss.state_stddev(stddev), cost.silhouette_px
        fitted = self.refine.outline(frames, self._output)
        both = np.array([mean, fitted])
        _, (mean_differs_px, differs_px), (mean_px, drawn_px), _ = cost.bodies(both)
        is_by_points = self._points.leads(iou_of(total, mean_px, mean_differs_px))
        if is_by_points and self._points.is_given:
            fitted = self._points.polished(fitted)
            _, (differs_px,), (drawn_px,), _ = cost.bodies(fitted[None])
        fit_iou = iou_of(total, drawn_px, differs_px)
        found = (mean, stddev), (mean_differs_px, mean_px), self._arm.spreads_m
        evidence = evidence_in(cost, rated, *found, self._age)
        self._chance = loss.remembered(loss.chance_of_loss(evidence), self._chance)
        found_by = *rated, self.rated.keypoints_m, config.spread, evidence, self._chance
        seen = frame, fitted, spread, fit_iou, Search(*found_by)
        result = fitted if is_by_points else self.refine.corrected(*seen)
        _, (cost_px,), (area_px,), points = cost.bodies(result[None])
        iou = iou_of(total, area_px, cost_px)
        self._result = result
        if self._plan.keeps_result:
            self._survivors[-1] = fitted  # in place of the worst one
        keypoints_m = points.keypoints_m[0]
        last = frame, result, spread, keypoints_m, iou
        deviations = spread if is_by_points else self.refine.deviations(*last)
        is_poor = self._chance > config.lost_from or fit_iou < self._lost_iou
        is_sure = self._chance <= config.uncertain_from and is_trackable(cost, fitted)
        learned = None if is_by_points else self.refine.chances_of_error()
        is_doubtful = self._points.is_doubtful(result)
        chances, states = judged(cost, result, deviations, learned, is_doubtful)
        is_sure = is_sure and are_sure(chances[HANDS])
        return Fit(
            posture=result[POSTURE],
            posture_stddev=deviations[POSTURE],
            keypoints_m=keypoints_m,
            cost_px=int(cost_px),
            iou=iou,
            is_uncertain=not is_sure or is_doubtful,
            is_poor=is_poor and not self._points.confirm(result),
            offset_m=result[PLACE],
            offset_stddev_m=deviations[PLACE],
            seen=fitted,
            seen_iou=fit_iou,
            particles=Particles(*rated, mean, config.spread, deviations / spread),
            keypoint_chances=chances,
            keypoint_states=states,
        )

    def ious(self) -> list[float | None]:
        """See :class:`~.pose_filter.PoseFilter`."""
        if self._output is None:
            return [None] * len(self._cost.costs)
        return self._cost.ious(self._result, self._seeing)
