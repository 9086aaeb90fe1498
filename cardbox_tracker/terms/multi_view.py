"""Ratings of whole bodies with one camera or several: the cost is the sum over the cameras.

The pixels of each camera are divided by the area of its silhouette, so that a near camera has no
larger weight:

    n rating = sum over n cameras of (pixels that differ) / (pixels of the silhouette) + priors

So a rating is a fraction of the silhouette, and priors have less weight with more cameras. A camera
that shows no person in a frame is ignored; the priors count once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.view import View
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    N_STATE,
    NEAREST_M,
    PITCH,
    ROLL,
    TORSO_X,
    TORSO_Z,
    YAW,
    state_limits,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.outline import Outline
from cardbox_tracker.terms.term import Frame, Silhouette, Term
from cardbox_tracker.terms.whole_body import Bodies, Ratings, WholeBodyCost, iou_of
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

# Distance for which the units of the priors of ``torso_x`` were chosen, m.
_NORMAL_M = 2.5

ToView = Callable[[FloatArray], FloatArray]
"""Transforms states (N, 14) or (14,) of the first camera into those of another camera."""


class MultiViewCost:
    """Ratings of states (N, 14) of the first camera, with the silhouettes of all cameras.

    The interface is that of :class:`~cardbox_tracker.terms.whole_body.WholeBodyCost`.

    Attributes:
        costs: the cost of each camera, the first camera's first.
        to_views: transform of states for each camera.
        x_factor: factor on the units of the priors of ``torso_x``.
        yaw_unit_rad: unit of the prior of the yaw.
        facing_rad: yaw around which the person turns; 0 faces the first camera.
        limits: lowest and highest value of each value of a state, (14, 2).
        seeing: indices of the cameras that show the person in this frame.
    """

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        views: Sequence[View],
        config: WholeBodyCostConfig,
    ) -> None:
        """Prepare for one body before ``camera`` and for the further ``views`` of the body."""
        self._config = config
        without_priors = replace(config, weight=0.0)
        self.costs = [WholeBodyCost(body, camera, config)]
        self.costs += [WholeBodyCost(view.body, view.camera, without_priors) for view in views]
        self.to_views: list[ToView] = [lambda states: states, *(view.states for view in views)]
        self.choose([0])
        first = self.costs[0]
        self.parts, self.place, self.body = first.parts, first.place, first.body
        self.x_factor, self.yaw_unit_rad = 1.0, np.radians(config.yaw_deg)
        self._z_units_m = config.z_step_m, config.z_home_m
        self.anchor = first.anchor
        self.face(0.0)

    def face(self, facing_rad: float) -> None:
        """Set the yaw around which the person turns: 0 faces the first camera."""
        self.facing_rad = facing_rad
        self.limits = state_limits(float(self.place[0]), facing_rad)

    def cover(self, covered: Sequence[Silhouette | None]) -> None:
        """Set the pixels (H, W) of other people, which do not count from the next :meth:`see`."""
        for cost, pixels in zip(self.costs, covered, strict=True):
            cost.covered = pixels

    def see(self, silhouettes: Sequence[Silhouette], state: FloatArray) -> None:
        """Set the silhouettes (H, W) of all cameras; the person is near the place of ``state``."""
        for cost, to_view, silhouette in zip(self.costs, self.to_views, silhouettes, strict=True):
            cost.see(silhouette, to_view(state))

    def expect(
        self,
        x_m: float,
        z_m: float,
        home_m: float,
        yaw_rad: float,
        lean_rad: float = 0.0,
        is_located: bool = False,
        shows_legs: bool = False,
    ) -> None:
        """Set the anchor of the priors: place of the last frame, home of x, expected yaw and lean.

        The yaw is that of somebody who faces the camera, 0 if nothing else is known. The lean is 0
        but for who squats: a person at rest who was expected to lean would lean and be too far
        away, which hardly changes the outline. An outline of a person who is twice as far away
        determines the distance half as well. The yaw is freer if the person ``is_located`` by
        points, and the height if these show the legs: who squats.
        """
        facing_rad = self.facing_rad
        # Who walks to one side turns from the back to it the other way round.
        yaw_rad = facing_rad + (-yaw_rad if facing_rad else yaw_rad)
        self.anchor[:] = x_m, z_m, home_m, yaw_rad, lean_rad
        self.x_factor = max((self.place[0] - x_m) / _NORMAL_M, 1.0)
        config = self._config
        self.yaw_unit_rad = np.radians(config.located_yaw_deg if is_located else config.yaw_deg)
        self._z_units_m = config.z_step_m, config.z_home_m
        if shows_legs:
            self._z_units_m = config.located_z_m, config.located_z_m
        self.costs[0].loosen(self.x_factor, self.yaw_unit_rad, self._z_units_m)

    def choose(self, seeing: Sequence[int]) -> None:
        """Use only the cameras with these indices in this frame."""
        self.seeing = tuple(seeing)
        self._others = [number for number in seeing if number]
        if 0 not in self.seeing:
            # The priors of the first camera count in any case.
            self.costs[0].see_nothing()

    def observe(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> None:
        """Set the observations of the further terms for each camera that shows the person."""
        for number, cost in enumerate(self.costs):
            counting = terms[number] if number in self.seeing else ()
            if not counting:
                cost.terms = ()
                continue
            # The pixels that count; those of the legs of a further camera's silhouette do not.
            frame = frames[number].changed(foreground_px=cost.silhouette_px)
            observed = (term.observe(frame) for term in counting)
            cost.terms = tuple(one for one in observed if one is not None)

    def outlines(self, state: FloatArray) -> list[tuple[int, Outline]]:
        """Return the outline of each camera that shows the person, near a state (14,), by index."""
        return [
            (number, self.costs[number].outline(self.to_views[number](state)))
            for number in self.seeing
        ]

    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Return mean and inverse variance (14,) of the priors of the torso, without their caps."""
        config, (x_m, z_m, home_m, yaw_rad, lean_rad) = self._config, self.anchor.tolist()
        mean, inverse = np.zeros((2, N_STATE))
        inverse[ROLL] = np.radians(config.roll_deg) ** -2
        mean[PITCH], inverse[PITCH] = lean_rad, np.radians(config.pitch_forward_deg) ** -2
        mean[YAW], inverse[YAW] = yaw_rad, self.yaw_unit_rad**-2
        step, home = (self.x_factor * np.array([config.x_step_m, config.x_home_m])) ** -2
        inverse[TORSO_X] = step + home
        mean[TORSO_X] = (step * x_m + home * home_m) / inverse[TORSO_X]
        step, home = (unit_m**-2 for unit_m in self._z_units_m)
        inverse[TORSO_Z] = step + home
        mean[TORSO_Z] = step * z_m / inverse[TORSO_Z]
        return mean, inverse

    @property
    def silhouette_px(self) -> int:
        """Foreground pixels that count, summed over the cameras that show the person."""
        return sum(self.costs[number].silhouette_px for number in self.seeing)

    def shares(self, state: FloatArray) -> list[tuple[float, float]]:
        """Return each camera's silhouette as shares of the frontal model's area.

        They are shares of the larger and of the smaller one of the areas at the measured distance
        and at that of ``state`` (14,).
        """
        found = []
        for cost, scale in zip(self.costs, self._scales(state), strict=True):
            share = cost.silhouette_px / cost.frontal_px
            found.append((share / max(scale, 1.0), share / min(scale, 1.0)))
        return found

    def frontal_px_at(self, state: FloatArray) -> int:
        """Return the pixels of the frontal model at the place of a state (14,), of all cameras."""
        scales = self._scales(state)
        areas_px = (scales[number] * self.costs[number].frontal_px for number in self.seeing)
        return max(round(sum(areas_px)), 1)

    def _scales(self, state: FloatArray) -> list[float]:
        """Return areas at the distance of ``state`` (14,), as multiples of the measured ones."""
        found = []
        for cost, to_view in zip(self.costs, self.to_views, strict=True):
            away_m = max(cost.place[0] - float(to_view(state)[TORSO_X]), NEAREST_M)
            found.append((cost.place[0] / away_m) ** 2)
        return found

    def torsos(self, states: FloatArray, arms_of: FloatArray) -> FloatArray:
        """Rate torsos (N,); the arms of the state ``arms_of`` keep their place in the images."""
        return self._sum(lambda cost, to_view: cost.torsos(to_view(states), to_view(arms_of)))

    def fix_torso(self, torso: FloatArray) -> None:
        """Rate arms beside the trunk of the state ``torso`` (14,) from now on."""
        for number in {0, *self.seeing}:
            self.costs[number].fix_torso(self.to_views[number](torso))

    def arms(self, arms: FloatArray, arm: int) -> tuple[FloatArray, FloatArray]:
        """Rate arms (N, 4), 0 left or 1 right, beside the fixed torso.

        Returns ratings (N,); shoulder, elbow and hand in the torso's frame, (N, 3, 3), metres.
        """
        ratings, joints_m = self.costs[0].arms(arms, arm)
        for number in self._others:
            ratings += self.costs[number].arms(arms, arm)[0]
        self._divide(ratings)
        return ratings, joints_m

    def arms_by_points(self, arms: FloatArray, arm: int) -> FloatArray:
        """Return approximate ratings (N,) of arms (N, 4), 0 left or 1 right, without priors."""
        joints = self.costs[0].joints(arms, arm)
        return self._sum(lambda cost, _: cost.arms_by_points(arms, joints, arm))

    def pairs(self, states: FloatArray, into: Ratings | None = None) -> Ratings:
        """Rate whole states (N, 14), N > 0, with the fixed torso; as :meth:`bodies`, but faster."""
        ratings, *points = self.costs[0].pairs(states, into)
        for number in self._others:
            ratings += self.costs[number].pairs(self.to_views[number](states)).ratings
        self._divide(ratings)
        return Ratings(ratings, *points)

    def bodies(self, states: FloatArray, into: Ratings | None = None) -> Bodies:
        """Rate whole states (N, 14), with the pixels of all cameras, and points of the first.

        Ratings and points are written to ``into`` if it is given.
        """
        ratings, costs_px, areas_px, points = self.costs[0].bodies(states, into)
        if 0 not in self.seeing:
            costs_px, areas_px = np.zeros((2, len(states)))
        for number in self._others:
            more = self.costs[number].bodies(self.to_views[number](states))
            ratings += more.ratings
            costs_px += more.costs_px
            areas_px += more.areas_px
        self._divide(ratings)
        return Bodies(ratings, costs_px, areas_px, points)

    def ious(self, state: FloatArray, seeing: Sequence[int]) -> list[float | None]:
        """Return the IoU of a state (14,) in each camera; None for those not in ``seeing``."""
        found: list[float | None] = [None] * len(self.costs)
        for number in seeing:
            cost = self.costs[number]
            rated = cost.bodies(self.to_views[number](state)[None])
            found[number] = iou_of(cost.silhouette_px, rated.areas_px[0], rated.costs_px[0])
        return found

    def _divide(self, ratings: FloatArray) -> None:
        """Divide the sum over the cameras by their number."""
        if len(self.seeing) > 1:
            ratings /= len(self.seeing)

    def _sum(self, rate: Callable[[WholeBodyCost, ToView], FloatArray]) -> FloatArray:
        ratings = rate(self.costs[0], self.to_views[0])
        for number in self._others:
            ratings += rate(self.costs[number], self.to_views[number])
        self._divide(ratings)
        return ratings
