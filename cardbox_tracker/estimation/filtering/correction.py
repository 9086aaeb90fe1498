"""A corrector that has learned where joints are, given a result and how it was found.

An outline is nearly the same for many depths, and the filter's result is one of them. Its error
depends on average on the posture found, on other postures that fit, on where the cameras stand, and
on the frames before. A recurrent network has learned that dependence from rendered recordings with
ground truth (``tools/make_correction.py``; the data file names them); another one has learned from
recordings of several cameras. Its hidden state also tells motion from noise, so that the result is
steadier without the delay of a filter.

The network sees one arm as if it were the left one, so both arms share it. For each arm it answers
where the middle of the shoulders is beside the place found, and where elbow and hand are beside
that, in metres along the axes of the optical frame.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

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
"""Names of the data files of the networks: for one camera, with or without depth, and several."""
# The angles among the values of a state.
_ANGLES = slice(1, 12)
_LEAST_BONE_M = 1e-6
_NO_DEPTH = np.zeros((2, DEPTH_FEATURES))
N_FEATURES = FEATURES + SEARCH_FEATURES + DEPTH_FEATURES
"""Inputs of the network: the result's, the search's, then those of the depth image."""
N_ANSWERS = 9
"""Outputs of the network: x, y, z of the middle of the shoulders, elbow and hand."""


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


class NetworkCorrector:
    """A :class:`~.corrector.Corrector` that asks a recurrent network.

    Attributes:
        features: input of the network in the last frame, (2, F).
        result_features: input of the network of the deviations in the last frame, (2, F).
    """

    def __init__(self, cost: WholeBodyCost, camera: Camera, network: RecurrentNetwork) -> None:
        """Prepare for the body of ``cost`` before ``camera``, the first one."""
        self._cost, self._camera, self._network = cost, camera, network
        # Who comes back is the same person, so nothing resets it.
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
        """See :class:`~.corrector.Corrector`: those of the angles are learned."""
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
    """Return the corrector of the package for one camera or several."""
    return NetworkCorrector(cost, camera, network_for(cameras))


def network_for(cameras: int) -> RecurrentNetwork:
    """Return the package's network that corrects the results of this number of cameras."""
    return load_recurrent_network(DATA if cameras == 1 else DATA_OF_SEVERAL)
