"""The whole-body filter before several cameras, of which any may be silent for a while.

What differs from one camera: the cost is a sum (:mod:`cardbox_tracker.estimation.cost.multi_view`);
arms are tried for what each camera leaves uncovered, and mirrored along each one's line of sight;
somebody who stands upright is looked for where the lines of sight meet; before all joints move
together three states that differ are fitted to all outlines, and what a frame ends with joins the
next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from cardbox_tracker.body.posture import STATE_LIMITS, TORSO_X, TORSO_Y
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import Frame, Term
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import iou_of
from cardbox_tracker.estimation.filtering import state_choice
from cardbox_tracker.estimation.filtering.arms import propose_arms
from cardbox_tracker.estimation.filtering.draws import Draws
from cardbox_tracker.estimation.filtering.pose_filter import Fit, Sight
from cardbox_tracker.estimation.filtering.refinement import Refinement
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter

# Of the rounds of all joints: the fraction of states that moves by differences, and how the noise
# shrinks from one round to the next.
_DIFFERING, _ROUND_DECAY = 0.8, 0.8
# Share of the arms near the best ones that does as well as all of them where the most promising are
# chosen.
_NEAR_ARMS = 0.6
# Before all joints move together, so many states, of which so many are alike and the others so far
# apart, m, are moved by so many Gauss-Newton steps.
_FITTED, _FIT_STEPS = (3, 1, 0.1), 2
# Deviation of where lines of sight meet: medians of outlines are not one point of a body.
_CROSSING_M = 0.1
# Lines of sight that are less apart, as the sine of the angle between them, do not measure x.
_LEAST_ANGLE = 0.05


class SeenBy(Protocol):
    """A further camera, as the filter needs it."""

    @property
    def view(self) -> View:
        """How that camera sees the body."""

    @property
    def terms(self) -> Sequence[Term]:
        """The further terms of its cost."""


class MultiViewFilter(WholeBodyFilter):
    """Follows states (14,) of the first camera by the frames of all cameras.

    A frame's ``others`` are those of ``cameras``; one without foreground says nothing.
    """

    candidates = 4
    _seeing: list[int]
    """Cameras that see the person in this frame, by their number."""

    def __init__(
        self,
        cameras: Sequence[SeenBy],
        config: TrackerConfig,
        silhouette: SilhouetteTerm,
        rng: np.random.Generator,
    ) -> None:
        """Prepare; see ``MakeFilter``, and ``cameras`` are those beside the first one."""
        super().__init__(_with_more_evidence(config), silhouette, rng)
        self._cameras = cameras
        views = [camera.view for camera in cameras]
        self._views = MultiViewCost(
            self._body,
            silhouette.camera,
            [(view.body, view.camera, view.states) for view in views],
            config.whole_body.cost,
        )
        self._cost = self._views
        others = list(zip(self._views.costs[1:], views, strict=True))
        self.refine = Refinement(self._one, silhouette.camera, config.whole_body, others)

    def look(self, frame: Frame) -> Sight:
        """See :class:`~.pose_filter.PoseFilter`: a person is there if any camera sees one."""
        self._frame = frame
        self._see_all(self._survivors[0])
        sights = [self._sight_of(cost.silhouette_px, cost.frontal_px) for cost in self._views.costs]
        self._seeing = [number for number, sight in enumerate(sights) if sight is Sight.PERSON]
        if self._seeing:
            return Sight.PERSON
        return Sight.TOO_MUCH if Sight.TOO_MUCH in sights else Sight.NOBODY

    def _see(self, state: FloatArray) -> None:
        self._see_all(state)
        self._views.choose(self._seeing)

    def _see_all(self, state: FloatArray) -> None:
        silhouettes = [self._frame.silhouette, *(other.silhouette for other in self._frame.others)]
        self._views.see(silhouettes, state)

    def _observe(self, terms: Sequence[Term]) -> None:
        views, before = self._views, self._survivors[0]
        self.refine.see(self._seeing)
        self._cross(before)
        self._step_m = 0.0
        if 0 in self._seeing:
            ahead_m = self._body.placement.distance_m - float(before[TORSO_X])
            sight = views.costs[0].sight()
            self._step_m = self._walk.see(self._frame.silhouette, sight, ahead_m)
        views.choose(self._seeing)
        frames = [self._frame, *self._frame.others]
        all_terms = [terms, *(camera.terms for camera in self._cameras)]
        views.observe(
            [
                [term.observe(frame) for term in some] if number in self._seeing else []
                for number, (frame, some) in enumerate(zip(frames, all_terms, strict=True))
            ]
        )

    def _cross(self, before: FloatArray) -> None:
        """Find where lines of sight meet; of a single line, the point nearest to ``before``.

        Least squares of the distances from all lines, and a little of that from ``before``.
        """
        distance_m = self._body.placement.distance_m
        last = np.array([float(before[TORSO_X]) - distance_m, float(before[TORSO_Y])])
        normal, right = _LEAST_ANGLE**2 * np.eye(2), _LEAST_ANGLE**2 * last
        for number in self._seeing:
            sight = self._views.costs[number].sight()
            if number:
                place, ahead = self._cameras[number - 1].view.line_of_sight(sight)
            else:
                place, ahead = np.zeros(2), np.array([-1.0, sight]) / np.hypot(1.0, sight)
            across = np.eye(2) - np.outer(ahead, ahead)
            normal = normal + across
            right = right + across @ place
        x, y = np.linalg.solve(normal, right).tolist()
        self._crossing_x_m = float(np.clip(x + distance_m, *STATE_LIMITS[TORSO_X]))
        self._sight = y / max(-x, 1e-3)

    def _upright(self, before: FloatArray, is_settled: bool) -> tuple[float, float, float]:
        _, sight, deviation_m = super()._upright(before, is_settled)
        if len(self._seeing) > 1 or 0 not in self._seeing:
            deviation_m = _CROSSING_M
        return self._crossing_x_m, sight, deviation_m

    def _propose_arms(
        self, pool: FloatArray, arm: int, normals: FloatArray, uniforms: FloatArray
    ) -> FloatArray:
        views, count, times = self._views, len(self._seeing), self.candidates
        ends = [times * (self._config.arms * part // count) for part in range(count + 1)]
        arms = np.concatenate(
            [
                propose_arms(
                    views.to_views[number](pool),
                    arm,
                    self._config,
                    views.costs[number],
                    (normals[begin:end], uniforms[begin:end]),
                    count,
                    times,
                )
                for number, begin, end in zip(self._seeing, ends, ends[1:], strict=False)
            ]
        )
        return self._promising(arms, arm)

    def _promising(self, arms: FloatArray, arm: int) -> FloatArray:
        # Neighbours are of one kind, so each kind stays.
        costs = self._views.arms_by_points(arms, arm).reshape(-1, self.candidates)
        best: FloatArray = arms[self.candidates * np.arange(len(costs)) + costs.argmin(axis=1)]
        return best

    def _together(self, states: FloatArray, ratings: FloatArray, draws: Draws) -> None:
        # Several outlines leave little that is flat: a step of Gauss and Newton is worth rounds.
        cost = self._cost
        kept = state_choice.choose_apart(states, ratings, *_FITTED, cost.parts, cost.girdle)
        fitted = np.array(
            [self.refine.outline.fitted(self._frame, state, _FIT_STEPS) for state in states[kept]]
        )
        fitted = np.clip(fitted, *STATE_LIMITS.T)
        states = np.concatenate([states, fitted])
        ratings = np.concatenate([ratings, self._cost.bodies(fitted)[0]])
        super()._together(states, ratings, draws)

    def ious(self) -> list[float | None]:
        """Return how well the last result covers each camera's silhouette of that frame.

        Intersection over union; None of a camera that saw nobody, or before the first result.
        """
        if self._output is None:
            return [None] * len(self._views.costs)
        found: list[float | None] = []
        for number, cost in enumerate(self._views.costs):
            if number not in self._seeing:
                found.append(None)
                continue
            state = self._views.to_views[number](self._result)
            _, (differ_px,), (drawn_px,) = cost.bodies(state[None])
            found.append(iou_of(cost.silhouette_px, drawn_px, differ_px))
        return found

    def _fit(self) -> Fit:
        fit = super()._fit()
        # The last survivor is the worst one.
        self._survivors[-1] = fit.seen
        assert fit.offset_m is not None
        self._result = np.concatenate([fit.posture, fit.offset_m])
        return fit

    def forget(self) -> None:
        """See :class:`~.pose_filter.PoseFilter`."""
        super().forget()
        self._seeing = []


def _with_more_evidence(config: TrackerConfig) -> TrackerConfig:
    """Return settings for several cameras: the fit is less flat, so steps are other ones.

    What was tried is in ``docs/two-cameras.md``.
    """
    whole = config.whole_body
    whole = replace(
        whole,
        arms_again=max(int(_NEAR_ARMS * whole.arms_again), 1),
        smoothing=whole.smoothing / 3,
        round_decay=max(whole.round_decay, _ROUND_DECAY),
        differing=max(whole.differing, _DIFFERING),
    )
    return replace(config, whole_body=whole)
