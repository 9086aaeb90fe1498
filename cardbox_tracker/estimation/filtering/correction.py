"""Corrector that predicts the places of joints with a recurrent network.

An outline is nearly the same for many depths, and the filter's result is one of them. Its mean
error depends on the posture, on other postures that fit, on the poses of the cameras, and on
previous frames. The recurrent network is trained on rendered recordings with ground truth
(``tools/make_correction.py``; the data file names them); a second network is trained on recordings
of several cameras. The hidden state also separates motion from noise, so that the result is
steadier without the delay of a low-pass filter.

Both arms share the network, whose input is a left arm or a mirrored right arm. Its outputs for each
arm are the displacement of the middle of the shoulders from the result, and the displacements of
elbow and hand from this middle, in metres along the axes of the optical frame.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from cardbox_tracker.body.posture import N_JOINTS, ROLL
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.corrector import Result
from cardbox_tracker.estimation.filtering.depth_features import DEPTH_FEATURES, features_of_depth
from cardbox_tracker.estimation.filtering.deviations import DATA as DATA_OF_DEVIATIONS
from cardbox_tracker.estimation.filtering.deviations import deviations_of
from cardbox_tracker.estimation.filtering.networks import (
    RecurrentNetwork,
    load_network,
    load_recurrent_network,
)
from cardbox_tracker.estimation.filtering.result_features import FEATURES, features_of
from cardbox_tracker.estimation.filtering.search_features import SEARCH_FEATURES, features_of_search
from cardbox_tracker.vision.camera import Camera

DATA, DATA_OF_SEVERAL = "correction.npz", "correction_views.npz"
"""Data files of the networks for one camera (with or without depth) and for several cameras."""
_ANGLES = slice(ROLL, N_JOINTS)
_LEAST_BONE_M = 1e-6
_NO_DEPTH = np.zeros((2, DEPTH_FEATURES))
N_FEATURES = FEATURES + SEARCH_FEATURES + DEPTH_FEATURES
"""Inputs of the network: features of the result, of the search, and of the depth image."""
N_ANSWERS = 9
"""Outputs of the network: x, y, z of the middle of the shoulders, elbow and hand."""


def moved(keypoints_m: FloatArray, answers_m: FloatArray) -> FloatArray:
    """Return the keypoints (6, 3) after the network's correction, metres in the optical frame.

    Bones keep their lengths: the corrected elbow only gives a direction from the corrected
    shoulder, and the corrected hand gives a direction from the resulting elbow.

    Args:
        keypoints_m: (6, 3), metres in the optical frame.
        answers_m: outputs for the left arm and the mirrored right arm, (2, 9): x, y, z of the
            middle of the shoulders, elbow and hand.
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
            # The outputs for the right arm are mirrored.
            other = -answers_m[1, axis] if axis == 0 else answers_m[1, axis]
            middle = 0.5 * (answers_m[0, axis] + other)
            for joint in range(first, first + 3):
                result[joint, axis] = keypoints_m[joint, axis] + middle
        for bone in (1, 2):
            end, begin = first + bone, first + bone - 1
            length, reach = 0.0, 0.0
            for axis in range(3):
                length += (keypoints_m[end, axis] - keypoints_m[begin, axis]) ** 2
                answer = answers_m[arm, 3 * bone + axis]
                answer = -answer if arm == 1 and axis == 0 else answer
                ahead[axis] = result[end, axis] + answer - result[begin, axis]
                reach += ahead[axis] ** 2
            scale = sqrt(length) / max(sqrt(reach), _LEAST_BONE_M)
            for axis in range(3):
                result[end, axis] = result[begin, axis] + scale * ahead[axis]


class NetworkCorrector:
    """A :class:`~.corrector.Corrector` with a recurrent network.

    Attributes:
        features: input of the network in the last frame, (2, F).
        result_features: input of the network of the deviations in the last frame, (2, F).
    """

    def __init__(self, cost: WholeBodyCost, camera: Camera, network: RecurrentNetwork) -> None:
        """Prepare for the body of ``cost`` before the first camera ``camera``."""
        self._cost, self._camera, self._network = cost, camera, network
        # A person who comes back is the same one, so the hidden state is never reset.
        self._hidden = network.initial_hidden(2)
        self._deviations = load_network(DATA_OF_DEVIATIONS)
        self.features = self.result_features = np.empty((2, 0))

    def __call__(self, found: Result) -> FloatArray:
        """See :class:`~.corrector.Corrector`."""
        self.features = np.concatenate(
            [
                _features_of(found),
                features_of_search(found.search, self._cost, found.keypoints_m),
                features_of_depth(found.frame, self._camera, found.keypoints_m)
                if found.viewpoints.has_depth
                else _NO_DEPTH,
            ],
            axis=1,
        )
        answers_m, self._hidden = self._network(self.features, self._hidden)
        return moved(found.keypoints_m, answers_m)

    def deviations(self, corrected: Result) -> FloatArray:
        """See :class:`~.corrector.Corrector`; the deviations of the angles are learned."""
        self.result_features = _features_of(corrected)
        stddev = corrected.stddev.copy()
        stddev[_ANGLES] = deviations_of(self._deviations, self.result_features[None])[0]
        return stddev


def _features_of(result: Result) -> FloatArray:
    """Return the features (2, F) of one result."""
    state, stddev, keypoints_m = (
        one[None] for one in (result.state, result.stddev, result.keypoints_m)
    )
    iou = np.array([result.iou])
    both: FloatArray = features_of(state, stddev, keypoints_m, iou, result.viewpoints)[0]
    return both


def learned(cost: WholeBodyCost, camera: Camera, cameras: int) -> NetworkCorrector:
    """Return the package's corrector for a number of cameras."""
    return NetworkCorrector(cost, camera, network_for(cameras))


def network_for(cameras: int) -> RecurrentNetwork:
    """Return the package's network for results of this number of cameras."""
    return load_recurrent_network(DATA if cameras == 1 else DATA_OF_SEVERAL)
