"""Fit of a posture to given keypoints, smoothed over time."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.posture import ARM_ANGLES, TURNS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints, pose_at_keypoints
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.low_pass import LowPass

# The fit changes place and arms; the torso keeps its angles.
_STDDEV = np.array([0.1, 0.0, 0.0, 0.0, *[0.3] * (2 * ARM_ANGLES), 0.1, 0.1])
_STEPS = 1


class SmoothedPosing:
    """Fits one body to keypoints; low-pass filters smooth the keypoints and the torso's angles."""

    def __init__(self, cost: WholeBodyCost, time_constant_s: float) -> None:
        """Prepare for the body of ``cost``; with a time constant of 0 there is no smoothing."""
        self._cost = cost
        self._keypoints, self._turns = LowPass(time_constant_s), LowPass(time_constant_s)

    def forget(self) -> None:
        """Forget the last values, because the next state may be at another place."""
        self._keypoints.forget()
        self._turns.forget()

    def __call__(self, state: FloatArray, keypoints_m: FloatArray, interval_s: float) -> FloatArray:
        """Return the state (14,) near ``state`` with the best fit to the smoothed keypoints.

        Args:
            state: initial state (14,), from which the torso's angles are taken.
            keypoints_m: (6, 3), metres in the optical frame.
            interval_s: time since the previous frame, s.
        """
        cost = self._cost
        posed = state.copy()
        posed[TURNS] = self._turns(state[TURNS], interval_s)
        wanted_m = self._keypoints(keypoints_m, interval_s)
        pose_at_keypoints(posed, cost.body, wanted_m, cost.limits)
        fit_keypoints(posed, cost.body, wanted_m, _STDDEV, cost.limits, STATE_STEP, _STEPS)
        return posed
