"""Corrector that predicts the places of joints with a recurrent network.

An outline is nearly the same for many depths, and the filter's result is one of them. Its mean
error depends on the posture, on other postures that fit, on the poses of the cameras, and on
previous frames. The network is trained on simulated recordings (``learning/correction.py``,
docs/research/learning.md). Where its copies, trained with other seeds, disagree, it does less. Its
hidden state also separates motion from noise, so that the result is steadier without the delay of a
low-pass filter.

Cameras that look from different directions see the depth, and a network did harm to films of real
people. So it corrects results of one camera, or of several that look in nearly the same direction.

Both arms share the network, whose input is a left arm or a mirrored right arm. Its outputs for each
arm are the displacement of the middle of the shoulders from the result, and the displacements of
elbow and hand from this middle, in metres along the axes of the optical frame; then the log-odds
that the corrected shoulder, elbow and hand are off by more than 30 cm.
"""

from __future__ import annotations

from math import log2, sqrt
from typing import Any

import numpy as np

from cardbox_tracker.body.posture import N_JOINTS, ROLL
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import kernel
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import pose_at_keypoints
from cardbox_tracker.estimation.cost.terms import USUAL_INTERVAL_S
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost, iou_of
from cardbox_tracker.estimation.filtering.corrector import Result
from cardbox_tracker.estimation.filtering.depth_features import DEPTH_FEATURES, features_of_depth
from cardbox_tracker.estimation.filtering.deviations import DATA as DATA_OF_DEVIATIONS
from cardbox_tracker.estimation.filtering.deviations import deviations_of
from cardbox_tracker.estimation.filtering.networks import (
    RecurrentNetwork,
    load_network,
    load_recurrent_network,
)
from cardbox_tracker.estimation.filtering.packed_network import PackedNetwork
from cardbox_tracker.estimation.filtering.point_features import POINT_FEATURES, features_of_points
from cardbox_tracker.estimation.filtering.result_features import FEATURES, features_of
from cardbox_tracker.estimation.filtering.search_features import SEARCH_FEATURES, features_of_search
from cardbox_tracker.vision.camera import Camera

DATA = "correction.npz"
"""Data file of the network."""
_ANGLES = slice(ROLL, N_JOINTS)
_LEAST_BONE_M, _LEAST_M2 = 1e-6, 1e-12
_LEAST_S = 0.005
# Shares of a correction that are tried in turn, until little of the silhouette is lost.
_SHARES = (1.0, 0.5, 0.25)
MOST_IOU_LOSS = 0.05
"""Largest loss of intersection over union that a correction may cause."""
MIDDLE_Z = 2
"""Answer for the depth of the middle of the shoulders, which is not used for measured people: on
sources that were left out, it makes their distance worse."""
DOUBT = 1.0
"""Weight of the networks' disagreement, which shortens the correction."""
_OF_SEARCH = slice(FEATURES, FEATURES + SEARCH_FEATURES)
N_FEATURES = FEATURES + SEARCH_FEATURES + DEPTH_FEATURES + POINT_FEATURES + 1
"""Inputs of the network: features of the result, of the search, of the depth image and of the
points, and the binary logarithm of the interval between frames."""
OF_POINTS = slice(N_FEATURES - 1 - POINT_FEATURES, N_FEATURES - 1)
OF_DEPTH = slice(OF_POINTS.start - DEPTH_FEATURES, OF_POINTS.start)
"""Columns of the inputs that most frames lack."""
DISPLACEMENTS, LOG_ODDS = slice(0, 9), slice(9, 12)
"""Outputs of the network for an arm: x, y, z of the middle of the shoulders, elbow and hand, m;
log-odds that shoulder, elbow and hand are off by more than ``FAR_M``."""
N_ANSWERS = LOG_ODDS.stop
FAR_M = 0.30
"""A keypoint that is farther off is wrong, m."""


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


def limited(answers_m: FloatArray, spread_m: FloatArray, doubt: float = DOUBT) -> FloatArray:
    """Return the answers (2, 9), each joint's displacement shortened where the networks differ.

    A displacement a with the spread s is multiplied by a^2 / (a^2 + doubt s^2): displacements that
    all networks agree on remain, others vanish.

    Args:
        answers_m: mean of the networks' answers, (2, 9).
        spread_m: their standard deviation, (2, 9).
        doubt: weight of the spread; 0 for the answers as they are.
    """
    shortened = np.empty((2, 9))
    _shorten(answers_m, spread_m, doubt, shortened)
    return shortened


@kernel
def _shorten(answers_m: Any, spread_m: Any, doubt: float, shortened: Any) -> None:
    """Write :func:`limited` to ``shortened``."""
    for arm in range(2):
        for first in range(0, 9, 3):
            squares, doubts = 0.0, 0.0
            for i in range(first, first + 3):
                squares += answers_m[arm, i] ** 2
                doubts += spread_m[arm, i] ** 2
            gain = squares / (squares + doubt * doubts + _LEAST_M2)
            for i in range(first, first + 3):
                shortened[arm, i] = gain * answers_m[arm, i]


@kernel
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
        self._cost, self._camera, self._network = cost, camera, PackedNetwork(network)
        # A person who comes back is the same one, so the hidden state is never reset.
        self._hidden = self._network.initial_hidden()
        self._deviations = load_network(DATA_OF_DEVIATIONS)
        self.features = self.result_features = np.empty((2, 0))
        self._log_odds: FloatArray = np.empty(0)
        self._is_used = False

    def __call__(self, found: Result) -> FloatArray:
        """See :class:`~.corrector.Corrector`."""
        self._is_used = not found.viewpoints.see_depth
        if not self._is_used:
            return found.keypoints_m
        self.features = inputs_of(found, self._cost, self._camera)
        answers, spread, self._hidden = self._network(self.features, self._hidden)
        self._log_odds = answers[:, LOG_ODDS].ravel()
        answers_m = limited(answers[:, DISPLACEMENTS], spread[:, DISPLACEMENTS])
        if found.viewpoints.is_measured:
            answers_m[:, MIDDLE_Z] = 0.0
        return self._inside_outline(found, answers_m)

    def _inside_outline(self, found: Result, answers_m: FloatArray) -> FloatArray:
        """Return the corrected keypoints, moved less if they would leave the silhouette."""
        for share in _SHARES:
            wanted_m = moved(found.keypoints_m, share * answers_m)
            state = found.state.copy()
            pose_at_keypoints(state, self._cost.body, wanted_m, self._cost.limits)
            rated = self._cost.bodies(state[None])
            iou = iou_of(self._cost.silhouette_px, rated.areas_px[0], rated.costs_px[0])
            if iou >= found.iou - MOST_IOU_LOSS:
                return wanted_m
        return found.keypoints_m

    def chances_of_error(self) -> FloatArray | None:
        """See :class:`~.corrector.Corrector`."""
        if not self._is_used:
            return None
        chances: FloatArray = 1.0 / (1.0 + np.exp(-self._log_odds))
        return chances

    def deviations(self, corrected: Result) -> FloatArray | None:
        """See :class:`~.corrector.Corrector`; the deviations of the angles are learned."""
        if not self._is_used:
            return None
        self.result_features = features_of_result(corrected)
        stddev = corrected.stddev.copy()
        stddev[_ANGLES] = deviations_of(self._deviations, self.result_features[None])[0]
        return stddev


def inputs_of(found: Result, cost: WholeBodyCost, camera: Camera) -> FloatArray:
    """Return the inputs of the network (2, F) for the left arm and the mirrored right arm."""
    frame, keypoints_m = found.frame, found.keypoints_m
    inputs = np.zeros((2, N_FEATURES))
    inputs[:, :FEATURES] = features_of_result(found)
    inputs[:, _OF_SEARCH] = features_of_search(found.search, keypoints_m)
    if found.viewpoints.has_depth:
        inputs[:, OF_DEPTH] = features_of_depth(frame, camera, keypoints_m)
    if frame.points is not None:
        inputs[:, OF_POINTS] = features_of_points(frame.points, camera, keypoints_m)
    inputs[:, -1] = log2(max(frame.interval_s, _LEAST_S) / USUAL_INTERVAL_S)
    return inputs


def features_of_result(result: Result) -> FloatArray:
    """Return the features (2, F) of one result, see :func:`~.result_features.features_of`."""
    state, stddev, keypoints_m = (
        one[None] for one in (result.state, result.stddev, result.keypoints_m)
    )
    iou, viewpoints = np.array([result.iou]), result.viewpoints.as_one()
    both: FloatArray = features_of(state, stddev, keypoints_m, iou, viewpoints)[0]
    return both


def learned(cost: WholeBodyCost, camera: Camera, cameras: int) -> NetworkCorrector:
    """Return the package's corrector; see :data:`~.corrector.MakeCorrector`."""
    del cameras
    return NetworkCorrector(cost, camera, load_recurrent_network(DATA))
