"""A learned correction of the result: where people's arms are when a search ends like this.

An outline is nearly the same for many depths, and the filter's result is one of them. How wrong it
is on average depends on the posture that was found, on what else would fit, on where the cameras
stand, and on what was found before. A small recurrent network has learned that dependence from
rendered recordings with ground truth (``tools/make_correction.py``; the data file names them). What
several cameras leave open is something else, so another one has learned from such recordings. Its
memory also tells motion from noise, so that the result is steadier, without a filter that lags. It
sees one arm as if it were the left one, so both arms share it, and gives for each where the middle
of the shoulders is beside the place found, and where elbow and hand are beside that, in metres
along the axes of the optical frame.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from cardbox_tracker.body.posture import STATE_LIMITS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints, pose_at_keypoints
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.depth_features import DEPTH_FEATURES, features_of_depth
from cardbox_tracker.estimation.filtering.low_pass import LowPass
from cardbox_tracker.estimation.filtering.networks import (
    RecurrentNetwork,
    load_recurrent_network,
)
from cardbox_tracker.estimation.filtering.result_features import Viewpoints, features_of
from cardbox_tracker.estimation.filtering.search_features import Search, features_of_search
from cardbox_tracker.vision.camera import Camera

DATA, DATA_OF_SEVERAL = "correction.npz", "correction_views.npz"
"""Names of the data files of the networks: for one camera, with or without depth, and several."""
# Place and arms move; the torso keeps its angles.
_STDDEV = np.array([0.1, 0.0, 0.0, 0.0, *[0.3] * 8, 0.1, 0.1])
_STEPS = 1
# Roll, pitch and yaw of the torso in a state.
_TURNS = slice(1, 4)
_LEAST_BONE_M = 1e-6
_NO_DEPTH = np.zeros((2, DEPTH_FEATURES))


def moved(keypoints_m: FloatArray, answers_m: FloatArray) -> FloatArray:
    """Return keypoints (6, 3) towards where the network says that they are, metres.

    Bones keep their lengths: what is said of an elbow is a direction from the shoulder as moved,
    what is said of a hand one from that elbow.

    Args:
        keypoints_m: (6, 3), metres in the optical frame.
        answers_m: of the left arm and of the mirrored right one, (2, 9): the middle of the
            shoulders, elbow and hand, x, y, z of each.
    """
    result = np.empty((6, 3))
    _move(keypoints_m, answers_m, result)
    return result


@njit(cache=True, nogil=True, error_model="numpy")
def _move(keypoints_m: Any, answers_m: Any, result: Any) -> None:
    """Write :func:`moved` to ``result``."""
    ahead = np.empty(3)
    for arm in range(2):
        first = 3 * arm
        for axis in range(3):
            # The right arm is seen in a mirror.
            other = -answers_m[1, axis] if axis == 0 else answers_m[1, axis]
            middle = 0.5 * (answers_m[0, axis] + other)
            for joint in range(first, first + 3):
                result[joint, axis] = keypoints_m[joint, axis] + middle
        for bone in (1, 2):
            end, begin = first + bone, first + bone - 1
            length, reach = 0.0, 0.0
            for axis in range(3):
                length += (keypoints_m[end, axis] - keypoints_m[begin, axis]) ** 2
                said = answers_m[arm, 3 * bone + axis]
                said = -said if arm == 1 and axis == 0 else said
                ahead[axis] = result[end, axis] + said - result[begin, axis]
                reach += ahead[axis] ** 2
            scale = sqrt(length) / max(sqrt(reach), _LEAST_BONE_M)
            for axis in range(3):
                result[end, axis] = result[begin, axis] + scale * ahead[axis]


def network_for(cameras: int) -> RecurrentNetwork:
    """Return the network that corrects what so many cameras have found."""
    return load_recurrent_network(DATA if cameras == 1 else DATA_OF_SEVERAL)


class Correction:
    """Corrects the results of the whole-body filter for one body.

    Attributes:
        features: what the network saw last, (2, F).
        found_m: keypoints before the last correction, (6, 3), metres in the optical frame.
    """

    def __init__(
        self, cost: WholeBodyCost, camera: Camera, smoothing_s: float = 0.0, cameras: int = 1
    ) -> None:
        """Prepare for the body of ``cost`` before ``camera``, the first one.

        Args:
            cost: of the first camera.
            camera: the first one.
            smoothing_s: time constant by which joints and the torso's angles are steadied.
            cameras: how many there are.
        """
        self._cost, self._camera = cost, camera
        self._keypoints, self._turns = LowPass(smoothing_s), LowPass(smoothing_s)
        self._network = network_for(cameras)
        # Who comes back is the same person, so nothing makes it forget.
        self._memory = self._network.new_memory(2)
        self.features, self.found_m = np.empty((2, 0)), np.empty((6, 3))

    def forget(self) -> None:
        """Begin anew with what is steadied: the next state may be of another place."""
        self._keypoints.forget()
        self._turns.forget()

    def __call__(
        self,
        frame: Frame,
        state: FloatArray,
        stddev: FloatArray,
        iou: float,
        search: Search,
        viewpoints: Viewpoints,
    ) -> FloatArray:
        """Return the state (14,) with its keypoints moved.

        Args:
            frame: what is seen; of its depth image nothing unless ``viewpoints`` say so.
            state: result of the filter, (14,).
            stddev: its deviations, (14,).
            iou: of model and silhouette.
            search: that has found it.
            viewpoints: how the person was seen.
        """
        cost = self._cost
        self.found_m = cost.keypoints(state)
        result = state[None], stddev[None], self.found_m[None], np.array([iou])
        self.features = np.concatenate(
            [
                features_of(*result, viewpoints)[0],
                features_of_search(search, cost, self.found_m),
                features_of_depth(frame, self._camera, self.found_m)
                if viewpoints.has_depth
                else _NO_DEPTH,
            ],
            axis=1,
        )
        answers_m, self._memory = self._network(self.features, self._memory)
        corrected = state.copy()
        corrected[_TURNS] = self._turns(state[_TURNS], frame.interval_s)
        wanted = self._keypoints(moved(self.found_m, answers_m), frame.interval_s)
        pose_at_keypoints(corrected, cost.body, wanted, STATE_LIMITS)
        fit_keypoints(corrected, cost.body, wanted, _STDDEV, STATE_LIMITS, STATE_STEP, _STEPS)
        return corrected
