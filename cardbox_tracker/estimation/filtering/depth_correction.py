"""A learned correction of depth: where people's arms are when an outline looks like this.

An outline is nearly the same for many depths, and the filter's result is one of them. How wrong it
is on average depends on the posture that was found, on its uncertainty and on the fit, and a small
neural network has learned that dependence from rendered recordings with ground truth
(``tools/make_depth_correction.py``; the data file names them). It sees one arm as if it were the
left one, so both arms share it, and gives three numbers, in metres along the optical axis: by how
much the middle of the shoulders is farther away, and by how much elbow and hand are, relative to
it. Bones keep their lengths, so what moves in depth moves in the image too.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.estimation.filtering.smoothing import Smoothed

_DATA = "depth_correction.npz"
# Place and arms move; the torso keeps its angles.
_STDDEV = np.array([0.1, 0.0, 0.0, 0.0, *[0.3] * 8, 0.1, 0.1])
_STEPS = 2
# Share of the last correction in the next one: it is noise where it changes from image to image.
_KEPT = 0.5
# A bone that points at the camera shows no direction in the image.
_MOST_DEPTH = 0.97
_OTHER_ARM = np.array([0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13])
_MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, *[1.0] * 10])
_OTHER_POINTS = np.array([3, 4, 5, 0, 1, 2])
_SHOULDERS = np.array([0, 3])


class Network(NamedTuple):
    """Some networks of the same shape, whose answers are averaged.

    Attributes:
        mean: of the features, (F,).
        scale: their deviations, (F,).
        most: scaled features beyond this count as this.
        weights: of each layer, (networks, inputs, outputs).
        biases: of each layer, (networks, 1, outputs).
        unit_m: of the three answers, (3,), metres.
    """

    mean: FloatArray
    scale: FloatArray
    most: float
    weights: tuple[FloatArray, ...]
    biases: tuple[FloatArray, ...]
    unit_m: FloatArray

    def __call__(self, features: FloatArray) -> FloatArray:
        """Return what is missing in depth, (n, 3), metres, of features (n, F)."""
        scaled = np.clip((features - self.mean) / self.scale, -self.most, self.most)
        values = np.broadcast_to(scaled, (len(self.weights[0]), *scaled.shape))
        for number, (weights, biases) in enumerate(zip(self.weights, self.biases, strict=True)):
            if number > 0:
                values = np.maximum(values, 0.0)
            values = values @ weights + biases
        answer: FloatArray = values.mean(axis=0) * self.unit_m
        return answer


@cache
def load_network() -> Network:
    """Return the network of the package."""
    with resources.as_file(resources.files(__package__).joinpath(_DATA)) as path:
        return read_network(path)


def read_network(path: Path) -> Network:
    """Return the network in a file that ``tools/make_depth_correction.py`` has written."""
    with np.load(path) as stored:
        names = [name for name in stored.files if name != "about"]
        data = {name: np.asarray(stored[name], np.float64) for name in names}
    layers = sum(name.startswith("weights") for name in names)
    return Network(
        data["mean"],
        data["scale"],
        float(data["most"]),
        tuple(data[f"weights{i}"] for i in range(layers)),
        tuple(data[f"biases{i}"] for i in range(layers)),
        data["unit_m"],
    )


def features_of(
    states: FloatArray, stddevs: FloatArray, keypoints_m: FloatArray, ious: FloatArray
) -> FloatArray:
    """Return what the network sees, (n, 2, F): the left arm, and the right one mirrored.

    Args:
        states: results of the filter, (n, 14).
        stddevs: their deviations, (n, 14).
        keypoints_m: (n, 6, 3), metres in the optical frame.
        ious: of model and silhouette, (n,).
    """
    middle = keypoints_m[:, _SHOULDERS].mean(axis=1, keepdims=True)
    arms = []
    for is_right in (False, True):
        state, stddev, points = states, stddevs, keypoints_m - middle
        if is_right:
            state, stddev = state[:, _OTHER_ARM] * _MIRROR, stddev[:, _OTHER_ARM]
            points = points[:, _OTHER_POINTS] * (-1.0, 1.0, 1.0)
        bones = points[:, (1, 2, 4, 5)] - points[:, (0, 1, 3, 4)]
        bones = (bones / np.linalg.norm(bones, axis=2, keepdims=True)).reshape(len(states), -1)
        hand = points[:, 2]
        arms.append(
            np.hstack([
                *(bones, bones**2, hand, hand**2, np.abs(hand[:, :1])),
                *(state, stddev, ious[:, None], np.abs(state[:, 3:4])),
            ])
        )  # fmt: skip
    return np.stack(arms, axis=1)


def missing_depth(keypoints_m: FloatArray, true_m: FloatArray) -> FloatArray:
    """Return what the network shall say of keypoints (n, 6, 3), (n, 2, 3), metres."""
    missing = (true_m - keypoints_m)[:, :, 2].reshape(-1, 2, 3)
    middle = missing[:, :, :1].mean(axis=1, keepdims=True)
    return np.concatenate([np.repeat(middle, 2, axis=1), missing[:, :, 1:] - middle], axis=2)


def moved_in_depth(keypoints_m: FloatArray, missing_m: FloatArray) -> FloatArray:
    """Return keypoints (n, 6, 3) moved in depth, bones as long as before.

    Args:
        keypoints_m: (n, 6, 3), metres in the optical frame.
        missing_m: middle of the shoulders, elbow and hand of either arm, (n, 2, 3), metres.
    """
    moved = np.empty_like(keypoints_m)
    _move_in_depth(keypoints_m, missing_m, moved)
    return moved


@njit(cache=True, nogil=True, error_model="numpy")
def _move_in_depth(keypoints_m: Any, missing_m: Any, moved: Any) -> None:
    """Write :func:`moved_in_depth` to ``moved`` (n, 6, 3)."""
    for n in range(len(keypoints_m)):
        found = keypoints_m[n]
        # The middle of the shoulders moves along its line of sight.
        ahead_m = 0.5 * (missing_m[n, 0, 0] + missing_m[n, 1, 0])
        ahead = ahead_m / (0.5 * (found[0, 2] + found[3, 2]))
        for i in range(3):
            shift = ahead * 0.5 * (found[0, i] + found[3, i])
            moved[n, 0, i], moved[n, 3, i] = found[0, i] + shift, found[3, i] + shift
        for arm in range(2):
            before = 0.0
            for bone in range(2):
                begin, end = 3 * arm + bone, 3 * arm + bone + 1
                x, y, z = found[end] - found[begin]
                by_m = missing_m[n, arm, 1 + bone]
                length = sqrt(x * x + y * y + z * z)
                most = max(_MOST_DEPTH * length, abs(z))
                depth = min(max(z + by_m - before, -most), most)
                aside = sqrt(max(length * length - depth * depth, 0.0))
                aside /= max(sqrt(x * x + y * y), 1e-9)
                moved[n, end, 0] = moved[n, begin, 0] + aside * x
                moved[n, end, 1] = moved[n, begin, 1] + aside * y
                moved[n, end, 2] = moved[n, begin, 2] + depth
                before = by_m


class DepthCorrection:
    """Corrects the results of the whole-body filter for one body before one camera."""

    def __init__(self, cost: WholeBodyCost, share: float) -> None:
        """Prepare for the body of ``cost``; so much of the correction counts."""
        self._cost, self._share, self._smoothed = cost, share, Smoothed(_KEPT)
        self._network = load_network()

    def forget(self) -> None:
        """Begin anew: the next state is of somebody else, or of another place."""
        self._smoothed.forget()

    def __call__(self, state: FloatArray, stddev: FloatArray, iou: float) -> FloatArray:
        """Return the state (14,) with its keypoints moved in depth.

        Args:
            state: result of the filter, (14,).
            stddev: its deviations, (14,).
            iou: of model and silhouette.
        """
        keypoints_m = self._cost.keypoints(state)[None]
        features = features_of(state[None], stddev[None], keypoints_m, np.array([iou]))
        missing_m = self._smoothed(self._share * self._network(features[0]))
        corrected = state.copy()
        fit_keypoints(
            corrected,
            self._cost.parts,
            self._cost.girdle,
            self._cost.place,
            self._cost.view,
            moved_in_depth(keypoints_m, missing_m[None])[0],
            _STDDEV,
            STATE_LIMITS,
            STATE_STEP,
            _STEPS,
        )
        return corrected
