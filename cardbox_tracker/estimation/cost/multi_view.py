"""Rate whole bodies by what one camera or several see: the cost is the sum over the cameras.

Each camera's silhouette counts by its own area, so a camera that is nearer has no more to say:

    n rating = sum over n cameras of (pixels that differ) / (pixels of the silhouette) + priors

so a rating stays a share of the silhouette, and priors weigh less where more cameras see. A camera
that sees nobody in a frame is left out; priors count once, whoever sees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame, Silhouette, Term
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera

ToView = Callable[[FloatArray], FloatArray]
"""Takes states (N, 14) or (14,) of the first camera; returns them as another camera has them."""


class MultiViewCost:
    """Ratings of states (N, 14), which are those of the first camera, before all cameras.

    It is asked like a :class:`~cardbox_tracker.estimation.cost.whole_body.WholeBodyCost`.

    Attributes:
        costs: the cost of each camera, the first camera's first.
        to_views: what turns states into those of each camera.
        seeing: cameras that see the person in this frame, by their number.
    """

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        views: Sequence[View],
        config: WholeBodyCostConfig,
    ) -> None:
        """Prepare for one body before ``camera``, and for each of the further ``views`` of it."""
        without_priors = replace(config, weight=0.0)
        self.costs = [WholeBodyCost(body, camera, config)]
        self.costs += [WholeBodyCost(view.body, view.camera, without_priors) for view in views]
        self.to_views: list[ToView] = [lambda states: states, *(view.states for view in views)]
        self.seeing: tuple[int, ...] = (0,)
        first = self.costs[0]
        self.parts, self.girdle = first.parts, first.girdle
        self.place, self.view, self.body = first.place, first.view, first.body
        self.anchor = first.anchor

    def see(self, silhouettes: Sequence[Silhouette], state: FloatArray) -> None:
        """Take the silhouettes (H, W) of all cameras, of a person about where ``state`` says."""
        for cost, to_view, silhouette in zip(self.costs, self.to_views, silhouettes, strict=True):
            cost.see(silhouette, to_view(state))

    def choose(self, seeing: Sequence[int]) -> None:
        """Let only the cameras of these numbers count in this frame."""
        self.seeing = tuple(seeing)
        if 0 not in self.seeing:
            # Its priors count all the same.
            self.costs[0].see_nothing()

    def observe(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> None:
        """Take what the further terms of each camera that sees say of its frame."""
        for number, cost in enumerate(self.costs):
            counting = terms[number] if number in self.seeing else ()
            cost.terms = tuple(term.observe(frames[number]) for term in counting)

    @property
    def silhouette_px(self) -> int:
        """Foreground pixels that count, of all cameras that see."""
        return sum(self.costs[number].silhouette_px for number in self.seeing)

    @property
    def frontal_px(self) -> int:
        """Pixels of the model in the front reference posture, before all cameras that see."""
        return sum(self.costs[number].frontal_px for number in self.seeing)

    def torsos(self, states: FloatArray, arms_of: FloatArray) -> FloatArray:
        """Rate torsos (N,), with the arms of a state drawn where they are in the images."""
        return self._sum(lambda cost, to_view: cost.torsos(to_view(states), to_view(arms_of)))

    def fix_torso(self, torso: FloatArray) -> None:
        """Rate arms beside the trunk of the state ``torso`` (14,) from now on."""
        for number in {0, *self.seeing}:
            self.costs[number].fix_torso(self.to_views[number](torso))

    def arms(self, arms: FloatArray, arm: int) -> FloatArray:
        """Rate arms (N, 4), 0 left or 1 right, beside the fixed torso."""
        return self._sum(lambda cost, to_view: cost.arms(arms, arm))

    def arms_by_points(self, arms: FloatArray, arm: int) -> FloatArray:
        """Return about what arms (N, 4) cost, 0 left or 1 right, without priors, (N,)."""
        joints = self.costs[0].joints(arms, arm)
        return self._sum(lambda cost, _: cost.arms_by_points(joints, arm))

    def bodies(self, states: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rate whole states (N, 14): ratings, differing and drawn pixels of all cameras, (N,)."""
        ratings, costs_px, areas_px = self.costs[0].bodies(states)
        if 0 not in self.seeing:
            costs_px, areas_px = np.zeros((2, len(states)))
        for number in self.seeing:
            if number:
                more = self.costs[number].bodies(self.to_views[number](states))
                ratings += more[0]
                costs_px += more[1]
                areas_px += more[2]
        ratings /= len(self.seeing)
        return ratings, costs_px, areas_px

    def ious(self, state: FloatArray, seeing: Sequence[int]) -> list[float | None]:
        """Return how well a state (14,) covers each camera's silhouette, as IoU.

        None of cameras that are not among ``seeing``.
        """
        found: list[float | None] = [None] * len(self.costs)
        for number in seeing:
            cost = self.costs[number]
            _, (differ_px,), (drawn_px,) = cost.bodies(self.to_views[number](state)[None])
            found[number] = iou_of(cost.silhouette_px, drawn_px, differ_px)
        return found

    def keypoints(self, state: FloatArray) -> FloatArray:
        """Return the keypoints (6, 3) of a state (14,), metres in the first optical frame."""
        return self.costs[0].keypoints(state)

    def _sum(self, rate: Callable[[WholeBodyCost, ToView], FloatArray]) -> FloatArray:
        ratings = rate(self.costs[0], self.to_views[0])
        for number in self.seeing:
            if number:
                ratings += rate(self.costs[number], self.to_views[number])
        ratings /= len(self.seeing)
        return ratings
