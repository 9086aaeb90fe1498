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

from math import sqrt
from typing import Any

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.keypoint_fit_kernels import fit_keypoints
from cardbox_tracker.estimation.cost.outline_distances import STATE_STEP
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.arms import STATE_LIMITS
from cardbox_tracker.estimation.filtering.networks import load_network
from cardbox_tracker.estimation.filtering.result_features import features_of
from cardbox_tracker.estimation.filtering.smoothing import Smoothed

DATA = "depth_correction.npz"
"""Name of the network's data file."""
# Place and arms move; the torso keeps its angles.
_STDDEV = np.array([0.1, 0.0, 0.0, 0.0, *[0.3] * 8, 0.1, 0.1])
_STEPS = 2
# Share of the last correction in the next one: it is noise where it changes from image to image.
_KEPT = 0.5
# A bone that points at the camera shows no direction in the image.
_MOST_DEPTH = 0.97


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
        self._network = load_network(DATA)

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
        pitch_rad = self._cost.pitch_rad
        features = features_of(state[None], stddev[None], keypoints_m, np.array([iou]), pitch_rad)
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
