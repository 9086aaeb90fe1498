"""States that fit a detector's points, as proposals of the whole-body filter.

A joint's point gives its line of sight. With the lengths of the bones, its depth is determined up
to the mirror image of each bone along this line, so all combinations are fitted and rated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.posture import (
    ARM_ANGLES,
    N_STATE,
    PITCH,
    ROLL,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    YAW,
)
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.joint_points import JointPointsObservation
from cardbox_tracker.estimation.cost.joint_points_fit import FittedTuple, fit_states
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering import point_doubt
from cardbox_tracker.estimation.filtering.arms import ARM_LIMITS
from cardbox_tracker.estimation.filtering.mirroring import mirrored_states
from cardbox_tracker.estimation.filtering.rated_states import RatedStates

# Gauss-Newton steps, and deviation of a value in a step, rad and m.
_STEPS, _STEP_DEVIATION = 3, 0.25
# Deviations (14,) of a result's values in its last fit, and steps of this fit.
_POLISH_DEVIATION = np.array([0.03, 0.05, 0.05, 0.08, *[0.2] * (2 * ARM_ANGLES), 0.05, 0.02])
_POLISH_STEPS = 2
# Frames without points after which the outlines determine the depth again.
_MISSING_FRAMES = 30
# A search that also rates points differs so much from wrong silhouettes only.
_WRONG_IOU = 0.6
# Number of states that are fitted, number of similar ones, least distance of the others, m.
_DIFFERENT = (6, 1, 0.1)


class PointFit:
    """Fits states of one body to the points of all cameras.

    Attributes:
        is_given: whether there are points in this frame.
        is_leading: whether points, instead of outlines, determine the depth: the person was not
            measured, and there were points a short time ago.
    """

    def __init__(
        self, cost: MultiViewCost, config: WholeBodyCostConfig, views: Sequence[View]
    ) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost, self._config = cost, config
        self._turned = [np.eye(N_STATE), *(view.turned for view in views)]
        self._moved = [np.zeros(N_STATE), *(view.moved for view in views)]
        self._damping = np.full(N_STATE, 1.0 / _STEP_DEVIATION**2)
        self.is_given = self.is_leading = False
        self._missing = _MISSING_FRAMES

    def see(self) -> None:
        """Take the points of the present frame from the observations of the cost's terms."""
        found = [
            (number, term)
            for number, cost in enumerate(self._cost.costs)
            for term in cost.terms
            if isinstance(term, JointPointsObservation)
        ]
        self.is_given = bool(found)
        self._missing = 0 if found else self._missing + 1
        is_measured = self._cost.costs[0].is_measured
        self.is_leading = self._missing < _MISSING_FRAMES and not is_measured
        if not found:
            return
        points, deviations, bones, away = zip(*(term.evidence for _, term in found), strict=True)
        self._numbers = numbers = [number for number, _ in found]
        self._observations = [term for _, term in found]
        costs = [self._cost.costs[number] for number in numbers]
        self._fitted: FittedTuple = (
            np.array(points),
            np.array(deviations),
            np.array(bones),
            np.array(away),
            np.array([self._turned[number] for number in numbers]),
            np.array([self._moved[number] for number in numbers]),
            np.array([(*cost.place, *cost.view) for cost in costs]),
        )

    def leads(self, iou: float) -> bool:
        """Return whether points, instead of the outlines, determine the result.

        Args:
            iou: intersection over union of the silhouettes and the search's result. It is low if
                the silhouettes are wrong, such as those of a background that has changed.
        """
        return self.is_leading or (self.is_given and iou < _WRONG_IOU)

    def torsos(
        self, survivors: FloatArray, before: FloatArray, reference: FloatArray
    ) -> FloatArray:
        """Return fitted states (4, 14), from survivors (N, 14), a turned and an upright state.

        Args:
            survivors: states of the last frame, the best first.
            before: the last state, (14,).
            reference: state of the front reference posture, (14,).
        """
        turned, upright = before.copy(), reference.copy()
        turned[YAW] *= -1.0
        upright[[TORSO_X, TORSO_Y]] = before[[TORSO_X, TORSO_Y]]
        return self._fitted_from(np.array([survivors[0], survivors[-1], turned, upright]))

    def bodies(self, rated: RatedStates) -> FloatArray:
        """Return fits (N, 14) of the best different states, and of the best one's mirror images."""
        chosen = rated.different(*_DIFFERENT)
        mirrored = mirrored_states(chosen[0], self._cost.body, ARM_LIMITS)
        return self._fitted_from(np.concatenate([chosen, mirrored[1:]]))

    def _fitted_from(self, states: FloatArray) -> FloatArray:
        """Return states (N, 14) near ``states`` that fit the points and the torso's priors."""
        fitted = np.ascontiguousarray(states).copy()
        given = self._fitted, self._prior(), self._damping
        fit_states(fitted, self._cost.body, *given, self._cost.limits, _STEPS)
        return fitted

    def polished(self, state: FloatArray) -> FloatArray:
        """Return the state (14,) near ``state``, mainly in depth, that fits the points."""
        fitted, prior = state[None].copy(), (state, _POLISH_DEVIATION**-2)
        given = self._fitted, prior, np.zeros(N_STATE)
        fit_states(fitted, self._cost.body, *given, self._cost.limits, _POLISH_STEPS)
        polished: FloatArray = fitted[0]
        return polished

    def confirm(self, state: FloatArray) -> bool:
        """Return whether a result, state (14,), agrees with certain points in this frame.

        A silhouette that it does not fit is then taken to be wrong.
        """
        if not self.is_given:
            return False
        scores = (one.evidence[0][:, 2] for one in self._observations)
        is_certain = any(point_doubt.are_certain(one) for one in scores)
        return is_certain and self._farthest_m(state) <= point_doubt.FAR_M

    def _farthest_m(self, state: FloatArray) -> float:
        states = [self._cost.to_views[number](state) for number in self._numbers]
        return point_doubt.distance_to_points(states, self._observations)

    def is_doubtful(self, state: FloatArray) -> bool:
        """Return whether a result, state (14,), is uncertain; see :mod:`.point_doubt`."""
        cost = self._cost
        if not self.is_given:
            # Without points for a while, the depth of such a person in one camera is a guess.
            return self.is_leading and len(cost.seeing) == 1
        farthest_m = self._farthest_m(state)
        if farthest_m > point_doubt.FAR_M or any(one.shows_back for one in self._observations):
            return True
        if not self.is_leading or len(cost.seeing) > 1 or self._numbers != [0]:
            return False
        seen = self._observations[0]
        features = point_doubt.features_of(cost.keypoints(state), seen, farthest_m)
        return point_doubt.chance_of_error(features) > point_doubt.UNCERTAIN_FROM

    def _prior(self) -> tuple[FloatArray, FloatArray]:
        """Return mean and inverse variance (14,) of the cost's priors of the torso."""
        config, (x_m, z_m, home_m, yaw_rad) = self._config, self._cost.anchor.tolist()
        mean, inverse = np.zeros((2, N_STATE))
        inverse[ROLL] = np.radians(config.roll_deg) ** -2
        inverse[PITCH] = np.radians(config.pitch_forward_deg) ** -2
        mean[YAW], inverse[YAW] = yaw_rad, np.radians(config.yaw_deg) ** -2
        units_m = self._cost.x_factor * np.array([config.x_step_m, config.x_home_m])
        step, home = (units_m**-2).tolist()
        inverse[TORSO_X] = step + home
        mean[TORSO_X] = (step * x_m + home * home_m) / inverse[TORSO_X]
        step, home = config.z_step_m**-2, config.z_home_m**-2
        inverse[TORSO_Z] = step + home
        mean[TORSO_Z] = step * z_m / inverse[TORSO_Z]
        return mean, inverse
