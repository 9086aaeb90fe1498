"""What the learned networks see of a result: one arm, as if it were the left one, and the torso."""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.whole_body_kernels import N_STATE, YAW

_OTHER_ARM = np.array([0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13])
_MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, *[1.0] * 10])
_OTHER_POINTS = np.array([3, 4, 5, 0, 1, 2])
# Of each bone of both arms: where it begins and ends among the keypoints.
_BEGIN, _END = np.array([0, 1, 3, 4]), np.array([1, 2, 4, 5])
_HAND = 2
# Directions of four bones and the hand's place, each with its squares; how far aside the hand is;
# the state, its deviations, IoU, size of the yaw and the camera's pitch.
FEATURES = 2 * 12 + 2 * 3 + 1 + 2 * N_STATE + 3


def features_of(
    states: FloatArray,
    stddevs: FloatArray,
    keypoints_m: FloatArray,
    ious: FloatArray,
    pitch_rad: float,
) -> FloatArray:
    """Return what a network sees, (n, 2, F): the left arm, and the right one mirrored.

    Args:
        states: results of the filter, (n, 14).
        stddevs: their deviations, (n, 14).
        keypoints_m: (n, 6, 3), metres in the optical frame.
        ious: of model and silhouette, (n,).
        pitch_rad: how far the camera looks down.
    """
    features = np.empty((len(states), 2, FEATURES))
    _fill(states, stddevs, keypoints_m, ious, pitch_rad, features)
    return features


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    states: Any, stddevs: Any, keypoints_m: Any, ious: Any, pitch_rad: float, features: Any
) -> None:
    """Write :func:`features_of` to ``features``."""
    for n in range(len(states)):
        for arm in range(2):
            row = features[n, arm]
            sideways = -1.0 if arm else 1.0
            for bone in range(4):
                begin, end = _BEGIN[bone], _END[bone]
                if arm:
                    begin, end = _OTHER_POINTS[begin], _OTHER_POINTS[end]
                x, y, z = keypoints_m[n, end] - keypoints_m[n, begin]
                length = sqrt(x * x + y * y + z * z)
                for axis, value in enumerate((sideways * x / length, y / length, z / length)):
                    row[3 * bone + axis] = value
                    row[12 + 3 * bone + axis] = value * value
            hand = _OTHER_POINTS[_HAND] if arm else _HAND
            for axis in range(3):
                middle = 0.5 * (keypoints_m[n, 0, axis] + keypoints_m[n, 3, axis])
                value = keypoints_m[n, hand, axis] - middle
                row[24 + axis] = sideways * value if axis == 0 else value
                row[27 + axis] = value * value
            row[30] = abs(row[24])
            for i in range(N_STATE):
                if arm:
                    row[31 + i] = states[n, _OTHER_ARM[i]] * _MIRROR[i]
                    row[31 + N_STATE + i] = stddevs[n, _OTHER_ARM[i]]
                else:
                    row[31 + i], row[31 + N_STATE + i] = states[n, i], stddevs[n, i]
            row[31 + 2 * N_STATE] = ious[n]
            row[32 + 2 * N_STATE] = abs(states[n, YAW])
            row[33 + 2 * N_STATE] = pitch_rad
