"""The whole-body filter: a few dozen whole postures survive from frame to frame.

A frame is searched by :data:`STAGES`, each of which adds rated states to those of the previous
ones: torsos, then arms beside the best torso, then states that are fitted to the cues, then all
joints together. :class:`~.refiner.Refiner` fits the weighted mean of the best states to all cues.
Proposals are in :mod:`.torso_proposals`, :mod:`.arm_search` and :mod:`.joint_moves`, ratings in
:mod:`cardbox_tracker.terms.multi_view`, and all numbers in :mod:`.whole_body_config`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.view import View
from cardbox_tracker.person.model import MEASURED
from cardbox_tracker.person.parts import BOTTOM, HEIGHT, TORSO
from cardbox_tracker.person.posture import (
    ARM_ANGLES,
    LEFT_ARM,
    PLACE,
    POSTURE,
    RIGHT_ARM,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    YAW,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search import doubt, joint_moves, state_choice, torso_proposals
from cardbox_tracker.search.approach import Approach
from cardbox_tracker.search.arm_search import ARM_LIMITS, ArmSearch
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.locating import Location, Locator
from cardbox_tracker.search.mirroring import mirrored_states, turned_states
from cardbox_tracker.search.particles import Particles
from cardbox_tracker.search.pose_filter import Fit, PersonPresence, Presence
from cardbox_tracker.search.rated_states import Draws, RatedStates
from cardbox_tracker.search.refiner import Prior, Refiner
from cardbox_tracker.search.visibility import are_hidden, is_trackable
from cardbox_tracker.search.whole_body_config import SearchProfile
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import Frame, Posed, Term
from cardbox_tracker.terms.whole_body import iou_of

# Deviation of ``torso_x`` of upright torsos, which is larger in the first frames of a search.
_SETTLED_X_M, _YOUNG_X_M = 0.25, 0.5
# Lateral step, m, after which the legs have left their last columns.
_STEP_M = 0.05
# Factor on the numbers of states in a frame whose cues tell where joints are.
_LOCATED_EFFORT = 0.25
# States that are fitted to such cues: number, number of similar ones, least distance of the others,
# m; Gauss-Newton steps, and deviation of a value in a step, rad and m.
_FITTED, _FITTED_STEPS, _FITTED_DAMPING = (6, 1, 0.1), 3, 0.25**-2
# The same for fits to outlines.
_OUTLINED, _OUTLINED_STEPS = (3, 1, 0.1), 2
# Inverse variances (14,) of the prior around the search's mean, angles in rad and places in m: the
# outline only moves it slightly, so that it does not become another posture of a similar outline.
_NEAR = (0.7 * np.array([0.1, 0.1, 0.1, 0.2, *[0.2] * (2 * ARM_ANGLES), 0.1, 0.1])) ** -2
# The same for cues that tell where joints are, which mainly correct the depth of the arms.
_LOCATED = np.array([0.03, 0.05, 0.05, 0.08, *[0.2] * (2 * ARM_ANGLES), 0.05, 0.02]) ** -2
# Yaw beside the direction that somebody faces from which they face the other way, rad.
_ASIDE_RAD = np.radians(95.0)
# Mirror images of a state (:func:`mirrored_states`) in which one arm differs.
_ONE_MIRRORED = [1, 2, 3, 4, 8, 12]
# Weight of the last correction by the outline in the next one, against jitter.
_KEPT = 0.6


class Search(NamedTuple):
    """What the stages of one frame's search share beside the filter itself."""

    profile: SearchProfile  #: numbers of the search
    before: FloatArray  #: state (14,) of the last frame
    location: Location  #: the person's place by the silhouettes
    draws: Draws  #: random numbers


class WholeBodyFilter:
    """Tracks states (14,) of the first camera; a :class:`~.pose_filter.PoseFilter`.

    A state is d1..d12, ``torso_x`` and ``torso_z``. Each of several cameras may show no person for
    a while.

    Attributes:
        rated: rated states of the last frame.
        refine: fits states to the cues of a frame.
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
        self._config = settings = config.whole_body
        self._profile = settings.profile_for(1 + len(views)).scaled(settings.effort)
        self._located = self._profile.scaled(_LOCATED_EFFORT)
        self._rng, self._lost_iou = rng, config.lost_iou
        self._reference = silhouette.body.reference_state()
        self.use(silhouette, views)
        self.approach = Approach(self._profile.home_rate)
        self.forget()

    def use(self, silhouette: SilhouetteTerm, views: Sequence[View]) -> None:
        """Rate and fit the body of ``silhouette`` from now on; states keep their place."""
        self._views, self._body = tuple(views), silhouette.body
        self._cost = cost = MultiViewCost(self._body, silhouette.camera, views, self._config.cost)
        # The person keeps facing as before.
        cost.face(float(self._reference[YAW]))
        self._presence = PersonPresence(cost, self._config)
        self._arm = ArmSearch(cost)
        self._locator = Locator(cost, self._body.placement.distance_m, views)
        self.refine = Refiner(cost, views)
        self._doubt = doubt.Doubt()
        is_measured = self._body.source == MEASURED
        self._outline = doubt.Source.MEASURED if is_measured else doubt.Source.OUTLINE

    def forget(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`."""
        self._survivors = self._reference[None].copy()
        self._seeing: list[int] = []
        self._is_new, self._is_lost = True, False
        self._age = 0
        self._face(0.0)
        self._presence.forget()
        self.approach.begin(0.0)
        self._locator.forget()
        self._output: FloatArray | None = None
        self._correction: FloatArray | None = None
        self._arm.forget()
        self._doubt.forget()

    def move(self, moved: Callable[[FloatArray], FloatArray]) -> None:
        """Go on from the states (N, 14) that ``moved`` makes of the present ones."""
        self._survivors = np.clip(moved(self._survivors), *self._cost.limits.T)
        self._output = self._correction = None
        self.approach.begin(float(self._survivors[0, TORSO_X]))

    def recover(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`; add an upright state, keep survivors."""
        self._is_lost = True
        # A wrong result must not be smoothed into the next one.
        self._output = self._correction = None

    def configure(self, config: TrackerConfig) -> None:
        """See :class:`~.pose_filter.PoseFilter`; all other settings of this filter restart it."""
        self._lost_iou = config.lost_iou

    def look(self, frames: Sequence[Frame]) -> Presence:
        """See :class:`~.pose_filter.PoseFilter`; one camera that shows a person is enough."""
        self._cost.cover([frame["covered"] for frame in frames])
        self._cost.see([frame.silhouette for frame in frames], self._survivors[0])
        presence, self._seeing = self._presence.see(frames, self._survivors[0])
        self._is_lost = self._is_lost or self._presence.is_elsewhere
        return presence

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """See :class:`~.pose_filter.PoseFilter`."""
        location = self._observe(frames, terms)
        # Whether somebody is first seen from behind is different for each camera.
        if self._is_new and any(cue.shows_back for number, cue in self._cues if number == 0):
            self._face(np.pi)
            self._survivors = self._reference[None].copy()
        passes = self._profile.start_passes if self._is_new else 1
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
            self._search(location)
        self._is_new = self._is_lost = False
        return self._fit(frames)

    def _observe(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Location:
        """Set the observations of the terms, and return the place of the person."""
        seeing, cost = self._seeing, self._cost
        location = self._locator.locate(frames, seeing, self._survivors[0])
        cost.choose(seeing)
        cost.observe(frames, terms)
        self._lean_rad = frames[0].lean_rad
        self._cues = [
            (number, cue) for number in seeing for cue in cost.costs[number].terms if cue.locates
        ]
        return location

    def _search(self, location: Location) -> None:
        """Run all stages once."""
        profile, cost = self._located if self._cues else self._profile, self._cost
        before = self._survivors[0].copy()
        approach, z_m = self.approach, float(before[TORSO_Z])
        approach.see(float(before[TORSO_X]))
        expected = approach.expected_m, z_m, approach.home_m, self._locator.yaw_rad, self._lean_rad
        shows_legs = any(cue.shows_legs for _, cue in self._cues)
        cost.expect(*expected, bool(self._cues), shows_legs)
        self.rated = RatedStates(cost)
        search = Search(profile, before, location, Draws(self._rng, profile))
        for stage in STAGES:
            stage(self, search)
        self._survivors = self.rated.different(profile.survivors, profile.alike, profile.apart_m)

    def torsos(self, search: Search) -> None:
        """Rate survivors and new torsos with arms; of a new person, also arms of upright ones."""
        profile, cost, before = search.profile, self._cost, search.before
        location = search.location
        is_settled = not self._is_new and self._age > doubt.SETTLED_FRAMES
        fresh = self._reference.copy()
        fresh[TORSO_X] = before[TORSO_X] if location.x_m is None else location.x_m
        fresh_x_m = location.x_stddev_m or (_SETTLED_X_M if is_settled else _YOUNG_X_M)
        upright = profile.fresh_torsos if is_settled else profile.torso_explorers
        noise = profile.noise()
        # The arms of a torso keep their angles.
        noise[LEFT_ARM] = noise[RIGHT_ARM] = 0.0
        torsos = torso_proposals.propose_torsos(
            self._survivors,
            (noise, cost.limits, _lever_m(cost)),
            location.step_m,
            profile.torso_explorers,
            (upright, fresh, fresh_x_m, location.bearing, float(cost.place[0])),
            search.draws.for_states(profile.torsos),
        )
        ratings = cost.torsos(torsos, before)
        pool = torso_proposals.pool_of(
            self._survivors, torsos, ratings, profile.best_torsos, before, cost.body, ARM_LIMITS
        )
        # Upright torsos were rated with the arms of the last frame, but keep their hanging arms.
        standing = torsos[len(torsos) - upright :]
        more = [standing, self.approach.nearer_and_farther(before, cost)]
        if self._cues:
            turned, hanging = before.copy(), self._reference.copy()
            turned[YAW] = 2.0 * cost.facing_rad - turned[YAW]
            hanging[[TORSO_X, TORSO_Y]] = before[[TORSO_X, TORSO_Y]]
            begin = [self._survivors[0], self._survivors[-1], turned, hanging]
            more.append(self._located_by_cues(np.array(begin)))
        self.rated.add(np.concatenate([pool, *more]))
        if (self._is_new or self._is_lost) and len(standing):
            # Its own arms make a wrong torso better than an upright one with hanging arms.
            rated = self.rated.ratings[len(pool) : len(pool) + upright]
            best = self.rated.best(profile.survivors)
            first = standing[np.argmin(rated)]
            self._add_arms(search, np.concatenate([first[None], best]), Draws(self._rng, profile))

    def arms(self, search: Search) -> None:
        """Rate arms beside the best torso, and pairs of the best ones."""
        self._add_arms(search, self.rated.best(search.profile.survivors), search.draws)

    def _add_arms(self, search: Search, pool: FloatArray, draws: Draws) -> None:
        """Search arms for the torso of the first state of a pool (M, 14), and rate their pairs."""
        self._cost.fix_torso(pool[0])
        left, right = (self._arm(pool, arm, search.profile, draws) for arm in (0, 1))
        most = search.profile.paired_arms
        self.rated.add_pairs(joint_moves.combine(pool[0], *left, *right, most))

    def fitted(self, search: Search) -> None:
        """Rate states that are fitted to the cues, from the best different ones."""
        rated = self.rated
        if self._views:
            # Several outlines tell more of a posture than one.
            chosen = rated.different(*_OUTLINED)
            near = Prior(chosen, _NEAR)
            rated.add(self.refine(chosen, self._cost.outlines(chosen[0]), near, _OUTLINED_STEPS)[0])
        if self._cues:
            chosen = rated.different(*_FITTED)
            # A point gives a line of sight, on which a bone has two directions.
            mirrored = mirrored_states(chosen[0], self._cost.body, ARM_LIMITS)
            rated.add(self._located_by_cues(np.concatenate([chosen, mirrored[1:]])))

    def _located_by_cues(self, states: FloatArray) -> FloatArray:
        """Return states (N, 14) near ``states`` that fit the cues and the priors of the torso."""
        prior = Prior(*self._cost.prior())
        return self.refine(states, self._cues, prior, _FITTED_STEPS, _FITTED_DAMPING)[0]

    def together(self, search: Search) -> None:
        """Move all joints of the best states together, and by the differences of others."""
        profile, rated = search.profile, self.rated
        sigma = profile.together_noise * profile.noise()
        sources = rated.different(profile.survivors, profile.alike, profile.apart_m)
        for number in range(profile.rounds):
            if number > 0:
                sources = rated.best(profile.survivors)
            moved = joint_moves.move_all(
                sources,
                (sigma, self._cost.limits, _lever_m(self._cost)),
                int(profile.differing * profile.together),
                profile.difference_scale,
                search.draws.for_states(profile.together),
            )
            rated.add(moved)
            sigma = profile.round_decay * sigma

    def _fit(self, frames: Sequence[Frame]) -> Fit:
        """Return the refined mean of the best states with its confidence."""
        profile, cost = self._profile, self._cost
        rated = self.rated.states, self.rated.ratings
        average = (self._located if self._cues else profile).average
        mean, stddev = state_choice.mean_and_spread(*rated, average, profile.spread)
        before = mean if self._output is None else self._output
        kept = self._config.smoothing * profile.smoothing
        self._output = kept * before + (1.0 - kept) * mean
        result = self._refined(frames, self._output)
        is_back = cost.facing_rad != 0.0
        if self._cues:
            # The image in which somebody is found to have turned counts as one of a back, too.
            (result,) = self._turned(result[None])
        mirrored = mirrored_states(result, cost.body, ARM_LIMITS)[_ONE_MIRRORED]
        found = cost.bodies(np.concatenate([result[None], mirrored]))
        ratings, points = found.ratings, found.points
        cost_px, area_px = found.costs_px[0], found.areas_px[0]
        deviations, total = doubt.deviations_of(stddev), cost.silhouette_px
        iou = iou_of(total, area_px, cost_px)
        pixels = float(total), float(cost.frontal_px_at(result)), float(area_px), float(cost_px)
        prior = float(ratings[0]) - float(cost_px) / max(total, 1)
        faced, ahead = self._faced(result)
        seen_m = points.keypoints_m[0]
        if faced:
            seen_m = Posed(cost.costs[faced].body, ahead[None]).keypoints_m[0]
        else:
            ahead[YAW] -= cost.facing_rad
        evidence = doubt.evidence_of_search(
            pixels, prior, self._arm.spreads_m, (ahead, deviations), cost.body, self._age
        )
        evidence |= doubt.evidence_of_arms(
            points.keypoints_m[0],
            seen_m,
            float(ratings[0]),
            (self.rated.keypoints_m, self.rated.ratings),
            (points.keypoints_m[1:], ratings[1:]),
        )
        for number, cue in self._cues:
            there = cost.to_views[number](result[None])
            evidence |= cue.evidence(Posed(cost.costs[number].body, there))
        evidence["cameras"] = np.full(6, float(len(self._seeing) > 1))
        source = doubt.Source.POINTS if self._cues else self._outline
        is_back = not faced and (is_back or cost.facing_rad != 0.0)
        evidence["back"] = np.full(6, float(is_back))
        veto = "" if is_trackable(cost, result) else "the person is too near, too far or cut off"
        veto = veto or (doubt.BACK if is_back else "")
        judged = self._doubt.judge(evidence, source, are_hidden(cost, result), veto)
        self._result = result
        if self._views:
            self._survivors[-1] = result  # in place of the worst one
        return Fit(
            posture=result[POSTURE],
            posture_stddev=deviations[POSTURE],
            keypoints_m=points.keypoints_m[0],
            cost_px=int(cost_px),
            iou=iou,
            # Points that the result fits show that a silhouette which it does not fit is wrong.
            is_poor=judged.is_poor or (iou < self._lost_iou and not self._cues),
            offset_m=result[PLACE],
            offset_stddev_m=deviations[PLACE],
            particles=Particles(*rated, mean, profile.spread),
            judged=judged,
        )

    def _faced(self, result: FloatArray) -> tuple[int, FloatArray]:
        """Return the camera that the person faces most, and the state (14,) before it.

        It is the first one, which may see the back, if no further one sees the person from ahead.
        """
        best, state = 0, result.copy()
        most = max(np.cos(result[YAW]), 0.0) if 0 in self._seeing else 0.0
        for number in self._seeing:
            there = self._cost.to_views[number](result)
            if number and np.cos(there[YAW]) > most:
                there[YAW] = np.angle(np.exp(1j * there[YAW]))
                best, state, most = number, there, np.cos(there[YAW])
        return best, state

    def _turned(self, found: FloatArray) -> FloatArray:
        """Return states (N, 14) that face as the points show, and search there from now on.

        Left and right are exchanged if the points have shown this for long. Somebody who turns to
        the side, and further, faces the other way from then on.
        """
        facing_rad = self._cost.facing_rad
        yaw_rad = float(found[-1, YAW]) - facing_rad
        way_rad = np.pi if facing_rad <= 0.0 else -np.pi
        if self._age and all(cue.shows_back for _, cue in self._cues):
            self._face(facing_rad + way_rad)
            self._survivors = turned_states(self._survivors, way_rad, ARM_LIMITS)
            self._output = self._correction = None
            return turned_states(found, way_rad, ARM_LIMITS)
        if abs(yaw_rad) > _ASIDE_RAD:
            facing_rad += np.copysign(np.pi, yaw_rad)
            if abs(facing_rad) > 1.5 * np.pi:
                # Once around, where the yaw begins again.
                for states in (self._survivors, found):
                    states[:, YAW] -= facing_rad
                self._output = self._correction = None
                facing_rad = 0.0
            self._face(facing_rad)
        return found

    def _face(self, facing_rad: float) -> None:
        """Search around the yaw ``facing_rad``; 0 faces the first camera."""
        self._cost.face(facing_rad)
        self._reference[YAW] = facing_rad

    def _refined(self, frames: Sequence[Frame], state: FloatArray) -> FloatArray:
        """Return the state (14,) near ``state`` that fits all cues best."""
        cost, steps = self._cost, self._profile.refining_steps
        # A depth image determines the distance better than an outline.
        outlines = cost.outlines(state) if frames[0].depth_m is None else []
        if self._cues:
            near = Prior(state, _LOCATED)
            found, _ = self.refine(state[None], [*outlines, *self._cues], near, 2 * steps)
            located: FloatArray = found[0]
            return located
        (refined,), _ = self.refine(state[None], outlines, Prior(state, _NEAR), steps)
        # Outlines alone jitter.
        before = refined - state if self._correction is None else self._correction
        self._correction = _KEPT * before + (1.0 - _KEPT) * (refined - state)
        smooth: FloatArray = np.clip(state + self._correction, *cost.limits.T)
        return smooth

    def ious(self) -> list[float | None]:
        """See :class:`~.pose_filter.PoseFilter`."""
        if self._output is None:
            return [None] * len(self._cost.costs)
        return self._cost.ious(self._result, self._seeing)


Stage = Callable[[WholeBodyFilter, Search], None]

STAGES: tuple[Stage, ...] = (
    WholeBodyFilter.torsos,
    WholeBodyFilter.arms,
    WholeBodyFilter.fitted,
    WholeBodyFilter.together,
)
"""The search of a frame: each stage adds rated states to those of the previous ones."""


def _lever_m(cost: MultiViewCost) -> float:
    """Return the height of the torso's top above the hips, which is about that of the shoulders."""
    return float(cost.parts[TORSO, BOTTOM] + cost.parts[TORSO, HEIGHT])
